"""The common part of the simulated firmwares of boards other than the paper's.

They sense the plant more finely than the paper's converters, and run at 1 kHz.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from quadrotor.motor_state import MotorState
from quadrotor.records import Record
from quadrotor.vehicle_model import Four
from vehicle.boards.reference_rounding import REFERENCE_MAX
from vehicle.simulator.firmware.firmware import REGISTERS
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.pseudo_terminal import PseudoTerminal, ServedPort
from vehicle.simulator.sensors import sense
from vehicle_link.serial.ids import Id

PERIOD_US = 1000
"""Period, in µs, at which it receives states, returns motor values and exchanges bytes."""


class BoardFirmware:
    """One board, like `vehicle.simulator.firmware.firmware.Firmware`, with finer sensors.

    Attributes:
        registers: (65,) int16, of which it uses only the period.
        references: counts of motor reference, motors front, left, rear, right.
    """

    lacking: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("imu.gaps", "simulator.lost_samples"),
        "this board sends a stream of bytes and no samples that could be lost; try "
        "simulator.corrupted_bytes",
    )
    """Faults that it cannot have, and why."""
    command = (0, 0, 0, 0)

    def __init__(self) -> None:
        self.registers: npt.NDArray[np.int16] = np.zeros(REGISTERS, np.int16)
        self.registers[Id.MIRROR_PERIOD] = PERIOD_US
        self.references: Four = (0.0, 0.0, 0.0, 0.0)
        self._sensed = np.zeros((2, 3))  # specific force in m/s^2, angular velocity in rad/s
        self._plant: Record | None = None
        self._sensors: Record | None = None
        self._pressure = 0.0
        self._missing = 0

    @property
    def motor_state(self) -> MotorState:
        return MotorState.ON if any(self.references) else MotorState.OFF

    @property
    def voltage(self) -> float:
        """Return the battery's voltage as it was last read, V."""
        assert self._sensors is not None
        return float(self._sensors["voltage"][0])

    def sense(
        self, plant: Record, sensors: Record, noise: npt.NDArray[np.float64], row: int
    ) -> None:
        """Store the readings of a PLANT (1,) for the next period."""
        self._plant, self._sensors = plant, sensors
        self._pressure = sense(plant, sensors, noise, row, self._sensed)

    def period(self, command: tuple[int, int, int, int]) -> None:
        """Run the firmware for one period with the stored readings."""
        raise NotImplementedError

    def receive(self, port: int, data: bytes) -> bytes:
        """Pass bytes to the firmware; `next_data` returns the answers."""
        raise NotImplementedError

    def next_data(self) -> tuple[int, bytes]:
        """Return (port, bytes sent by the firmware)."""
        raise NotImplementedError

    def fail(self) -> None:
        """Simulate a permanent failure of the board."""
        raise NotImplementedError

    def set_missing(self, motors: int) -> None:
        """Set the bits of the motors that do not turn."""
        self._missing = motors

    def _turn(self, shares: Four) -> None:
        """Set the motors to these shares, 0 to 1, of the largest reference."""
        front, left, rear, right = (
            0.0 if self._missing >> k & 1 else REFERENCE_MAX * max(0.0, share)
            for k, share in enumerate(shares)
        )
        self.references = front, left, rear, right

    def open_port(self, link: Path) -> ServedPort:
        """Return the simulated end of its line: a pseudo-terminal at this link.

        Raises StorageError or LinkError.
        """
        return PseudoTerminal(link)

    def configure(self, parameters: SimulatorParameters) -> None: ...

    def advance(self, elapsed_ms: int) -> None: ...

    def steps(self, ms: int, count: int, step_ms: int) -> None: ...

    def set_period(self, sixteenths: int) -> None: ...

    def close(self) -> None: ...
