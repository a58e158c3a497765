"""A simulated vehicle with faults, stepped without a flight stack."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from quadrotor.motor_state import MotorState
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from quadrotor.plain_rotations import Array
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.sensors import ACCELEROMETER_SCALE, ZERO
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle_link.serial.ids import PRESSURE_OFFSET, Id

QUIET = {
    **dict.fromkeys(("accelerometer_noise", "gyroscope_noise", "pressure_noise"), 0.0),
    **{f"accelerometer_bias_{axis}": 0.0 for axis in "xyz"},
    **{f"gyroscope_bias_{axis}": 0.0 for axis in "xyz"},
}
STEP_S = 0.002


def truth(faults: str, values: Mapping[str, ParameterValue]) -> SimulatorParameters:
    parameters = SimulatorParameters()
    ParameterStore(parameters).preset({**values, "faults": faults})
    return parameters


class Flown:
    """One simulated vehicle, stepped, with what it reads."""

    def __init__(self, faults: str, **values: float) -> None:
        self.simulated = SimulatedVehicle(truth(faults, {**QUIET, **values}))
        self.board = Microcontroller(self.simulated.ports, 0)
        self.samples = 0

    def step(self, command: tuple[int, int, int, int] | None = None) -> None:
        self.simulated.step()
        self.samples += len(self.board.receive())
        if command is not None:
            self.board.command(command)
        self.board.service(1e-9 * self.simulated.stamp_ns)

    def until(self, seconds: float) -> None:
        while self.simulated.stamp_ns < 1e9 * seconds - 1:
            self.step()

    def count(self, register: Id, axis: int = 0) -> int:
        return int(self.simulated.firmware.registers[register + axis])

    @property
    def pressure(self) -> int:
        return self.count(Id.PRESSURE) + PRESSURE_OFFSET

    @property
    def force(self) -> Array:
        """Return what the accelerometer reads, m/s^2."""
        counts = [self.count(Id.ACCELEROMETER_X, axis) - ZERO for axis in range(3)]
        return ACCELEROMETER_SCALE * np.array(counts)

    def throw(self, height: float = 2.0, spin: tuple[float, float, float] = (0, 0, 0)) -> None:
        """Put it into the air, turning with this angular velocity (rad/s), motors off."""
        self.simulated.place((0.0, 0.0, height))
        self.simulated.truth["angular_velocity_b"] = spin


def fly(faults: str, steps: int, **values: ParameterValue) -> tuple[list[object], bytes]:
    """Return every sample and the truth at the end of a flight with held references."""
    simulated = SimulatedVehicle(truth(faults, {**values, "seed": 5}))
    board = Microcontroller(simulated.ports, 0)
    board.set_motor_state(MotorState.ON)
    samples: list[object] = []
    for _ in range(steps):
        simulated.step()
        samples += board.receive()
        board.command((125, 126, 125, 125))
        board.service(1e-9 * simulated.stamp_ns)
    return samples, simulated.truth.tobytes()
