"""The truth at a moment: the parameters, and what only faults change."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from bearing_sim.faults.fault import Fault, Memory
from bearing_sim.faults.schedule import Moment
from vehicle.simulator.vibration import LINES

if TYPE_CHECKING:
    from quadrotor.records import Record
    from vehicle.simulator.parameters import SimulatorParameters

Array = npt.NDArray[np.float64]

SENSORS = ("accelerometer", "gyroscope")
AXES = ("x", "y", "z")
PRESSURE, BATTERY = 6, 7
"""Channels of the sensors, after three of the accelerometer and three of the gyroscope."""


@dataclass
class Truth:
    """The true values at a moment, for faults to change.

    Attributes:
        parameters: a copy that belongs to this moment.
        position_w: of the vehicle, (3,) m.
        accelerometer, gyroscope: matrices (3, 3) that the readings are multiplied by.
        accelerometer_range, gyroscope_range: m/s^2 and rad/s, where readings are cut off.
        stuck: channels that keep their last reading.
        shaking: rms, m/s^2, that each rotor adds to the vibration.
        centre_b: m, of the centre of mass from the middle of the rotors, x and y.
        products_b: kg m^2, entries xy, xz and yz of the inertia.
        load: mass in kg, and length of the cable in m.
    """

    parameters: SimulatorParameters
    position_w: Array
    accelerometer: Array = field(default_factory=lambda: np.eye(3))
    gyroscope: Array = field(default_factory=lambda: np.eye(3))
    accelerometer_range: float = math.inf
    gyroscope_range: float = math.inf
    stuck: set[int] = field(default_factory=set)
    shaking: Array = field(default_factory=lambda: np.zeros(4))
    centre_b: tuple[float, float] = (0.0, 0.0)
    products_b: tuple[float, float, float] = (0.0, 0.0, 0.0)
    load: tuple[float, float] = (0.0, 0.0)

    def write(self, plant: Record, sensors: Record) -> None:
        """Write the effects that are no parameters into a PLANT and a SENSORS record of these
        parameters.
        """
        for name, matrix in (("accelerometer", self.accelerometer), ("gyroscope", self.gyroscope)):
            sensors[f"{name}_matrix"] = matrix @ sensors[f"{name}_matrix"][0]
        sensors["accelerometer_range"] = self.accelerometer_range
        sensors["gyroscope_range"] = self.gyroscope_range
        sensors["stuck"] = 0
        sensors["stuck"][0, sorted(self.stuck)] = 1
        self._shake(sensors)
        plant["centre_b"], plant["products_b"] = self.centre_b, self.products_b
        plant["full_inverse_b"] = 0.0
        if any(self.products_b):
            xy, xz, yz = self.products_b
            off = np.array([[0.0, xy, xz], [xy, 0.0, yz], [xz, yz, 0.0]])
            diagonal = np.diag(plant["model"]["inertia_b"][0])
            plant["full_inverse_b"] = np.linalg.inv(diagonal + off)
        self._hang(plant)

    def _shake(self, sensors: Record) -> None:
        if not self.shaking.any():
            return
        before = float(sensors["vibration"][0])
        whole = math.hypot(before, float(np.linalg.norm(self.shaking)))
        lines = before * sensors["imbalance"][0] + math.sqrt(2.0) * self.shaking / LINES
        sensors["vibration"], sensors["imbalance"] = whole, lines / whole

    def _hang(self, plant: Record) -> None:
        mass, length = self.load
        if mass > 0.0 and plant["load_mass"][0] == 0.0:  # hung up now, below the vehicle
            plant["load"][0, :3] = plant["x"][0, :3]
            plant["load"][0, 2] = max(0.0, plant["x"][0, 2] - length)
            plant["load"][0, 3:] = plant["x"][0, 3:6]
        plant["load_mass"], plant["load_length"] = mass, length


class VehicleFault(Fault):
    """Base of the faults that change the simulated vehicle itself."""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        """Change the truth of this moment."""
        raise NotImplementedError


def channel(sensor: str, axis: str) -> int:
    """Return the channel of one axis of an inertial sensor."""
    return 3 * SENSORS.index(sensor) + AXES.index(axis)
