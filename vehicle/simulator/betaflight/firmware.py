"""The real Betaflight firmware behind the interface of the simulated microcontroller."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from quadrotor.errors import UsageError
from quadrotor.parameters import Parameters
from quadrotor.records import Record
from quadrotor.vehicle_model import Four
from vehicle.boards.betaflight.configuration import mode_lines, required
from vehicle.boards.betaflight.messages import Function
from vehicle.boards.betaflight.options import BetaflightOptions
from vehicle.boards.kind import BETAFLIGHT, MIKROKOPTER
from vehicle.boards.reference_rounding import REFERENCE_MAX
from vehicle.simulator.betaflight.process import BetaflightProcess
from vehicle.simulator.firmware.firmware import REGISTERS
from vehicle.simulator.sensors import sense
from vehicle_link.msp.frames import REPLY, encode
from vehicle_link.serial.ids import Id, MotorState

PERIOD_US = 1000
"""Period, in µs, at which it receives states, returns motor values and exchanges bytes."""
BYTES = 64
"""Largest number of bytes sent at once, so that a late reader loses nothing of a long answer."""
_ANALOG = encode(Function.ANALOG, bytes(9), REPLY)[:8]
_VOLTAGE_AT = 7
FRAME = (
    "mixer QUADP",
    "set ap_altitude_d = 40",
    *(f"set {name}_roll = {value}" for name, value in (("p", 18), ("i", 0), ("d", 0), ("f", 0))),
    *(f"set {name}_pitch = {value}" for name, value in (("p", 18), ("i", 0), ("d", 0), ("f", 0))),
    *(f"set {name}_yaw = {value}" for name, value in (("p", 90), ("i", 0), ("f", 0))),
)
"""Lines that a person enters for this vehicle: its mixer, the damping of its own landing, and gains
near `control.attitude.kw`."""


class BetaflightFirmware:
    """One board, like `vehicle.simulator.firmware.firmware.Firmware`, with finer sensors.

    Attributes:
        registers: (65,) int16, of which it uses only the period.
        references: counts of motor reference, motors front, left, rear, right.
    """

    command = (0, 0, 0, 0)

    def __init__(self, options: BetaflightOptions) -> None:
        settings = required(options).items()
        lines = [f"set {name} = {value}" for name, value in settings]
        self._process = BetaflightProcess([*lines, *mode_lines(), *FRAME, "save"])
        self.registers: npt.NDArray[np.int16] = np.zeros(REGISTERS, np.int16)
        self.registers[Id.MIRROR_PERIOD] = PERIOD_US
        self.references: Four = (0.0, 0.0, 0.0, 0.0)
        self._sensed = np.zeros((2, 3))
        self._plant: Record | None = None
        self._pressure = 0.0
        self._missing = 0
        self._unsent = b""

    @property
    def motor_state(self) -> MotorState:
        return MotorState.ON if any(self.references) else MotorState.OFF

    def sense(
        self, plant: Record, sensors: Record, noise: npt.NDArray[np.float64], row: int
    ) -> None:
        """Store the readings of a PLANT (1,) for the next period."""
        self._plant = plant
        self._pressure = sense(plant, sensors, noise, row, self._sensed)

    def period(self, command: tuple[int, int, int, int]) -> None:
        """Run the firmware for one period with the stored readings."""
        assert self._plant is not None
        force, rates = self._sensed.tolist()
        quaternion = self._plant["x"][0, 6:10].tolist()
        motors = self._process.step(1000 * PERIOD_US, rates, force, quaternion, self._pressure)
        front, left, rear, right = (
            0.0 if self._missing >> k & 1 else REFERENCE_MAX * max(0.0, motor)
            for k, motor in enumerate(motors)
        )
        self.references = front, left, rear, right

    def receive(self, port: int, data: bytes) -> bytes:
        """Pass bytes to the firmware; `next_data` returns the answers."""
        self._process.port.write(data)
        return b""

    def next_data(self) -> tuple[int, bytes]:
        """Return (port, bytes sent by the firmware)."""
        data = self._process.port.read()
        self._unsent += self._with_battery(data) if _ANALOG in data else data
        sent, self._unsent = self._unsent[:BYTES], self._unsent[BYTES:]
        return 0, sent

    def _with_battery(self, data: bytes) -> bytes:
        """Return the bytes with the plant's voltage; this firmware target has no meter."""
        before, after = data.split(_ANALOG, 1)
        assert self._plant is not None
        voltage = round(100.0 * float(self._plant["voltage"][0]))
        payload = after[:_VOLTAGE_AT] + voltage.to_bytes(2, "little")
        return before + encode(Function.ANALOG, payload, REPLY) + after[len(payload) + 1 :]

    def set_missing(self, motors: int) -> None:
        """Set the bits of the motors that do not turn."""
        self._missing = motors

    def advance(self, elapsed_ms: int) -> None: ...

    def steps(self, ms: int, count: int, step_ms: int) -> None: ...

    def set_period(self, sixteenths: int) -> None: ...

    def fail(self) -> None:
        """Simulate a permanent failure of the board."""
        self._process.kill()

    def close(self) -> None:
        self._process.close()


def firmware_of(board: str, options: Parameters | None) -> BetaflightFirmware | None:
    """Return the firmware of a simulated vehicle with this board; None: the simulator's own one.

    Raises UsageError for a board that cannot be simulated, and the errors of `BetaflightProcess`.
    """
    if board == MIKROKOPTER:
        return None
    if board == BETAFLIGHT and isinstance(options, BetaflightOptions):
        return BetaflightFirmware(options)
    raise UsageError(
        f"board {board} is not simulated: fly {MIKROKOPTER} or {BETAFLIGHT}, or the vehicle itself"
    )
