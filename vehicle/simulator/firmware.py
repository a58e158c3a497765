"""The microcontroller's firmware: bytes in, bytes out.

This is the first firmware: it knows direct mode only, so it refuses (by echoing what it keeps) a
set of the flight control mode to near-hovering, and when commands are missing for 0.25 s it stops
the motors and reports the emergency state, where the paper's would land by itself.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vehicle_link.serial.commands import (
    MIRROR,
    REQUEST,
    SET,
    Instruction,
    decode_instruction,
    encode_data,
    encode_mirrored,
    encode_value,
)
from vehicle_link.serial.frames import FrameDecoder
from vehicle_link.serial.ids import MIRROR as DEFAULT_MIRROR
from vehicle_link.serial.ids import TIME_PERIOD_MS, FlightControlMode, Id, MotorState

COMMAND_TIMEOUT_MS = 250
ROBOT_ID = 1
FIRMWARE_REVISION = 1
REGISTERS = max(Id) + 1
START_MS = 58_000
"""Time at power-up: late enough that every run soon passes the wrap at 60 s."""

_TIME, _MOTOR_STATE, _MOTOR_1 = int(Id.TIME), int(Id.MOTOR_STATE), int(Id.MOTOR_REFERENCE_1)
_STOPPED = (0, 0, 0, 0)

# From which states the motors may be brought into which; emergency is entered by itself only.
_ALLOWED = {
    MotorState.INIT: (MotorState.INIT, MotorState.OFF),
    MotorState.ON: (MotorState.ON, MotorState.INIT, MotorState.OFF),
    MotorState.EMERGENCY: (MotorState.EMERGENCY,),
    MotorState.OFF: tuple(MotorState),
}


class Firmware:
    """One microcontroller behind `ports` serial lines; sensors write into `registers`.

    Attributes:
        registers: (65,) int16, by Id.
        references: motor references (counts) on the motors' bus, all 0 unless the motors are on.
    """

    def __init__(self, ports: int = 2) -> None:
        self.registers: npt.NDArray[np.int16] = np.zeros(REGISTERS, np.int16)
        self.references: tuple[int, int, int, int] = _STOPPED
        self._unsigned = self.registers.view(np.uint16)
        self._decoders = [FrameDecoder() for _ in range(ports)]
        self._turn = 0
        self._ms = 0
        self._heard_ms = 0
        self._state = MotorState.INIT
        self._set_mirror(DEFAULT_MIRROR)
        for id, value in (
            (Id.ROBOT_ID, ROBOT_ID),
            (Id.FIRMWARE_REVISION, FIRMWARE_REVISION),
            (Id.FLIGHT_CONTROL_MODE, FlightControlMode.DIRECT),
            (Id.MIRROR_ACTIVE, 1),
            (Id.SECOND_SERIAL_ENABLED, int(ports > 1)),
            (Id.EMERGENCY_TIMEOUT, COMMAND_TIMEOUT_MS),
        ):
            self.registers[id] = value

    @property
    def motor_state(self) -> MotorState:
        return self._state

    def receive(self, port: int, data: bytes) -> bytes:
        """Take bytes from one line; the replies to send on it."""
        decoder = self._decoders[port]
        replies = b""
        for frame in decoder.feed(data):
            instruction = decode_instruction(frame)
            if instruction is not None:
                replies += self._obey(instruction)
        if decoder.damaged:
            errors = int(self._unsigned[Id.CRC_ERRORS]) + decoder.damaged
            self._unsigned[Id.CRC_ERRORS] = errors & 0xFFFF
            decoder.damaged = 0
        return replies

    def advance(self, elapsed_ms: int) -> None:
        """Set the time since power-up; stops the motors when commands are missing."""
        self._ms = elapsed_ms
        if self._state is MotorState.ON and elapsed_ms - self._heard_ms > COMMAND_TIMEOUT_MS:
            self._enter(MotorState.EMERGENCY)

    def next_data(self) -> tuple[int, bytes]:
        """(port, `D` frame) of the registers as they are; the lines take turns."""
        port = self._turn
        self._turn = (port + 1) % len(self._decoders)
        self._unsigned[_TIME] = (START_MS + self._ms) % TIME_PERIOD_MS
        return port, encode_data(self.registers[self._mirror].tobytes())

    def _obey(self, instruction: Instruction) -> bytes:
        self._heard_ms = self._ms
        if self._state is MotorState.ON:
            self.references = instruction.references
        kind = instruction.kind
        if kind == SET:
            return self._set(instruction)
        if kind == REQUEST:
            return self._value(instruction.id)
        if kind == MIRROR:
            if all(id < REGISTERS for id in instruction.ids):
                self._set_mirror(instruction.ids)
            return encode_mirrored(self._mirror.tolist())
        return b""

    def _set(self, instruction: Instruction) -> bytes:
        """Only the motor state can be set here; the echo tells what holds afterwards."""
        if instruction.id == Id.MOTOR_STATE and instruction.value in _ALLOWED:
            wanted = MotorState(instruction.value)
            if self._state in _ALLOWED[wanted]:
                self._enter(wanted)
                if wanted is MotorState.ON:
                    self.references = instruction.references
        return self._value(instruction.id)

    def _value(self, id: int) -> bytes:
        if not 0 <= id < REGISTERS:
            return b""
        for motor, reference in enumerate(self.references):
            self.registers[_MOTOR_1 + motor] = reference
        return encode_value(id, int(self.registers[id]))

    def _set_mirror(self, ids: tuple[int, ...]) -> None:
        self._mirror: npt.NDArray[np.intp] = np.array(ids, np.intp)

    def _enter(self, state: MotorState) -> None:
        self._state = state
        self.registers[_MOTOR_STATE] = state
        if state is not MotorState.ON:
            self.references = _STOPPED
