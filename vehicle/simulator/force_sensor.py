"""A force/torque sensor under the turning motor of a vehicle on the bench, and a tachometer.

The sensor is an ATI Nano17 SI-12-0.12: readings in steps of 1/320 N and 1/64 N mm, noise, and an
offset that is subtracted, determined once as the mean with the motor off. It has its own random
numbers, so that it does not affect those of other parts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from quadrotor.records import Record
from quadrotor.vehicle_model import thrust_of_reference
from vehicle.simulator.parameters import SimulatorParameters

Array = npt.NDArray[np.float64]

PERIOD_NS = 5_000_000
"""Period of the readings, 200 Hz."""
FORCE_STEP, TORQUE_STEP = 1.0 / 320.0, 1.0 / 64_000.0
"""Resolution of the readings, in N and N m."""
OFFSET_FORCE, OFFSET_TORQUE = 0.3, 0.002
"""Standard deviation of the unloaded readings' offset, in N and N m."""
OFFSET_READINGS = 400
"""Number of readings averaged for the offset."""
STANDING = 1.0
"""Speed, in counts, below which a motor counts as stopped."""
_STREAM = 11
"""Stream of random numbers, separate from others with the same seed."""


@dataclass(frozen=True, slots=True)
class ForceReading:
    """A reading relative to the one with the motor off; speed in counts, NaN without tachometer."""

    stamp_ns: int
    force: float  # N along the thrust
    torque: float  # N m about it
    speed: float


class ForceSensor:
    """Generator of readings from a PLANT."""

    def __init__(self, parameters: SimulatorParameters) -> None:
        self._random = np.random.default_rng((parameters.seed, _STREAM))
        self._next_ns = 0
        self._offset = np.zeros(2)
        self._offset_read: Array | None = None

    def read(
        self, stamp_ns: int, plant: Record, parameters: SimulatorParameters
    ) -> ForceReading | None:
        """Return the reading at `stamp_ns`.

        Returns None when none is due, no motor turns or the sensor is unplugged.
        """
        if stamp_ns < self._next_ns or parameters.bench_sensor == "none":
            return None
        speeds = plant["rotor_speeds"][0]
        motor = int(speeds.argmax())
        if speeds[motor] < STANDING:
            return None
        self._next_ns = stamp_ns - stamp_ns % PERIOD_NS + PERIOD_NS
        noise = np.array((parameters.bench_force_noise, parameters.bench_torque_noise))
        if self._offset_read is None:
            self._offset = self._random.standard_normal(2) * (OFFSET_FORCE, OFFSET_TORQUE)
            shown = self._offset + noise * self._random.standard_normal((OFFSET_READINGS, 2))
            self._offset_read = _in_steps(shown).mean(axis=0)
        p, model = plant[0], plant["model"][0]
        thrust = thrust_of_reference(speeds[motor], model["motor_slope"], model["motor_offset"])
        force = p["thrust_efficiency"] * p["battery_share"] * p["motor_gain"][motor] * thrust
        turn = model["torque_ratio"] if motor % 2 == 0 else -model["torque_ratio"]
        true = np.array((force, turn * force))
        drawn = self._random.standard_normal(3)
        shown = _in_steps(true + self._offset + noise * drawn[:2]) - self._offset_read
        speed = math.nan
        if parameters.bench_sensor == "force and speed":
            speed = float(speeds[motor] + parameters.bench_speed_noise * drawn[2])
        return ForceReading(stamp_ns, float(shown[0]), float(shown[1]), speed)


def _in_steps(shown: Array) -> Array:
    """Return the readings (…, 2) quantised by the sensor's converters."""
    steps = np.array((FORCE_STEP, TORQUE_STEP))
    whole: Array = np.round(shown / steps) * steps
    return whole
