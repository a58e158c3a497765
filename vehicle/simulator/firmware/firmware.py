"""The microcontroller's firmware: serial protocol, modes, and supervision of the onboard computer.

Missing commands, an empty battery or a set of the motor state cause the emergency: the firmware
then ignores commands, lands by itself (vehicle.simulator.firmware.descent) and switches the motors
off. The only command that it still obeys is *off*, the emergency cut.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from quadrotor.motor_state import MotorState
from vehicle.simulator.firmware.hovering import DEFAULT_GAINS
from vehicle.simulator.firmware.memory import new_program, set_period
from vehicle.simulator.firmware.program import period
from vehicle.simulator.firmware.statistics import Statistics
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
from vehicle_link.serial.ids import TIME_PERIOD_MS, FlightControlMode, Id

COMMAND_TIMEOUT_MS = 250
BATTERY_LAND = 131
"""Voltage, in 0.1 V, below which the emergency begins after BATTERY_TIME_MS."""
BATTERY_TIME_MS = 1000
EMERGENCY_THRUST = 74
"""Least thrust of the descent, where 110 is hover."""
LONGEST_LANDING_MS = 120_000
ROBOT_ID = 1
FIRMWARE_REVISION = 1
REGISTERS = max(Id) + 1
START_MS = 58_000
"""Time, in ms, at power-up, chosen so that every run soon passes the wrap at 60 s."""

_TIME, _MOTOR_STATE, _BATTERY = int(Id.TIME), int(Id.MOTOR_STATE), int(Id.BATTERY)
_TIMEOUT = int(Id.EMERGENCY_TIMEOUT)
_ON = MotorState.ON
_STOPPED = (0, 0, 0, 0)

ALLOWED = {
    MotorState.INIT: frozenset({MotorState.INIT, MotorState.OFF}),
    MotorState.ON: frozenset({MotorState.ON, MotorState.INIT, MotorState.OFF}),
    MotorState.EMERGENCY: frozenset({MotorState.EMERGENCY, MotorState.ON}),
    MotorState.OFF: frozenset(MotorState),
}
"""States from which each may be set: off from all (the cut), and from emergency only off."""

WRITABLE = frozenset(
    {
        Id.ACCELEROMETER_OFFSET_X,
        Id.ACCELEROMETER_OFFSET_Y,
        Id.ACCELEROMETER_OFFSET_Z,
        Id.GAIN_P,
        Id.GAIN_D,
        Id.GAIN_I,
        Id.GAIN_YAW_RATE,
        Id.GAIN_YAW_ACCELERATION,
        Id.YAW_CONTROL_TYPE,
        Id.MIRROR_PERIOD,
        Id.DRIFT_ESTIMATION_ACTIVE,
        Id.FLIGHT_CONTROL_MODE,
        Id.CONTROL_PERIOD_MIN,
        Id.ESTIMATION_PERIOD_MIN,
        Id.COMMAND_PERIOD_MIN,
        Id.DATA_PERIOD_MIN,
        Id.IMU_PERIOD_MIN,
        Id.EMERGENCY_THRUST,
        Id.EMERGENCY_TIMEOUT,
        Id.PORT_PIN,
    }
)
"""Values that may be set besides the motor state; a set of another id is echoed unchanged."""

LIMITS = {
    Id.FLIGHT_CONTROL_MODE: (0, 1),
    Id.EMERGENCY_TIMEOUT: (50, 5000),  # ms
    Id.EMERGENCY_THRUST: (28, 110),
    Id.MIRROR_PERIOD: (1000, 20_000),  # us
}
"""Bounds of the values that have any."""


class Firmware:
    """One microcontroller on `ports` serial lines; sensors write into `registers`.

    Attributes:
        registers: (65,) int16, by Id.
        program: PROGRAM (1,), the state of the compiled period.
        command: the four bytes of the newest command, all 0 unless the motors are on.
    """

    def __init__(self, ports: int = 2) -> None:
        self.registers: npt.NDArray[np.int16] = np.zeros(REGISTERS, np.int16)
        self.program = new_program()
        self.command: tuple[int, int, int, int] = _STOPPED
        self.statistics = Statistics(self.registers)
        self.steps = self.statistics.steps
        self._program = self.program[0]
        self._unsigned = self.registers.view(np.uint16)
        self._decoders = [FrameDecoder() for _ in range(ports)]
        self._turn = 0
        self._ms = 0
        self._heard_ms = 0
        self._charged_ms = 0
        self._emergency_ms = 0
        self._state = MotorState.INIT
        self._set_mirror(DEFAULT_MIRROR)
        for id, value in {
            Id.ROBOT_ID: ROBOT_ID,
            Id.FIRMWARE_REVISION: FIRMWARE_REVISION,
            Id.FLIGHT_CONTROL_MODE: FlightControlMode.NEAR_HOVERING,
            Id.MIRROR_ACTIVE: 1,
            Id.DRIFT_ESTIMATION_ACTIVE: 1,
            Id.SECOND_SERIAL_ENABLED: int(ports > 1),
            Id.EMERGENCY_TIMEOUT: COMMAND_TIMEOUT_MS,
            Id.EMERGENCY_THRUST: EMERGENCY_THRUST,
            **DEFAULT_GAINS,
        }.items():
            self.registers[id] = value

    @property
    def motor_state(self) -> MotorState:
        return self._state

    @property
    def references(self) -> tuple[int, ...]:
        """Return motor references (counts) on the motors' bus."""
        return tuple(self._program["references"].tolist())

    def receive(self, port: int, data: bytes) -> bytes:
        """Process bytes from one line and return the replies to send on it."""
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
        """Set the time since power-up; check whether an emergency begins or ends."""
        self._ms = elapsed_ms
        if self._state is _ON:
            if self.registers.item(_BATTERY) > BATTERY_LAND:
                self._charged_ms = elapsed_ms
            silent = elapsed_ms - self._heard_ms > self.registers.item(_TIMEOUT)
            if silent or elapsed_ms - self._charged_ms > BATTERY_TIME_MS:
                self._enter(MotorState.EMERGENCY)
        elif self._state is MotorState.EMERGENCY and (
            self._program["landed"] or elapsed_ms - self._emergency_ms > LONGEST_LANDING_MS
        ):
            self._enter(MotorState.OFF)

    def next_data(self) -> tuple[int, bytes]:
        """Return (port, `D` frame) of the present registers; the lines alternate."""
        port = self._turn
        self._turn = (port + 1) % len(self._decoders)
        self._unsigned[_TIME] = (START_MS + self._ms) % TIME_PERIOD_MS
        self.statistics.packet(port, self._ms)
        return port, encode_data(self.registers[self._mirror].tobytes())

    def period(self, command: tuple[int, int, int, int]) -> None:
        """Run estimation, then control, with the registers' sensors and the bytes of a command."""
        period(self._program, self.registers, command)

    def set_period(self, sixteenths: int) -> None:
        """Set the gains for a period in 1/16 us."""
        set_period(self.program, sixteenths)

    def set_missing(self, motors: int) -> None:
        """Set the bits of the motors whose controllers do not answer."""
        self.program["missing"] = motors

    # ------------------------------------------------------------------ instructions
    def _obey(self, instruction: Instruction) -> bytes:
        self._heard_ms = self._ms
        self.statistics.command(self._ms)
        if instruction.kind == SET:
            return self._set(instruction)
        self._take(instruction)
        if instruction.kind == REQUEST:
            return self._value(instruction.id)
        if instruction.kind == MIRROR:
            if all(id < REGISTERS for id in instruction.ids):
                self._set_mirror(instruction.ids)
            return encode_mirrored(self._mirror.tolist())
        return b""

    def _take(self, instruction: Instruction) -> None:
        if self._state is _ON:
            self.command = instruction.references

    def _set(self, instruction: Instruction) -> bytes:
        """Set a value; return its echo with the resulting value.

        A mode is set together with its command.
        """
        id, value = instruction.id, instruction.value
        if id == Id.MOTOR_STATE:
            self._set_motor_state(value)
        elif self._state is not MotorState.EMERGENCY and id in WRITABLE:
            low, high = LIMITS.get(Id(id), (-32768, 32767))
            if low <= value <= high:
                self.registers[id] = value
        self._take(instruction)
        return self._value(id)

    def _set_motor_state(self, value: int) -> None:
        if value not in ALLOWED or self._state not in ALLOWED[MotorState(value)]:
            return
        if value == MotorState.ON and self._program["missing"]:
            return  # motors do not start with a controller missing; ids 61…64 report which
        self._enter(MotorState(value))

    def _value(self, id: int) -> bytes:
        if not 0 <= id < REGISTERS:
            return b""
        return encode_value(id, int(self.registers[id]))

    def _set_mirror(self, ids: tuple[int, ...]) -> None:
        self._mirror: npt.NDArray[np.intp] = np.array(ids, np.intp)

    def _enter(self, state: MotorState) -> None:
        if state is self._state:
            return
        self._state = state
        self.registers[_MOTOR_STATE] = state
        self._charged_ms = self._heard_ms = self._ms
        self.command = _STOPPED
        self._emergency_ms = self._ms
        self._program["landed"] = 0
