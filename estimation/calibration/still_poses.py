"""Detection of poses held still in a stream of samples, for the calibration of the accelerometer.

A pose counts once the sensor has been still for a whole window, and another only after the sensor
has been turned: a vehicle left on the bench gives one pose, not a hundred.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from quadrotor.records import Array

FORCE_DEVIATION_MAX = 0.15
"""Largest standard deviation on any axis within the window, m/s^2."""
TURN_MAX = math.radians(3.0)
"""Largest angular velocity, rad/s."""
APART = math.radians(10.0)
"""Angle, in rad, by which a pose must differ from the last one."""
SATURATION = 19.4
"""Specific force, in m/s^2, at or beyond which on any axis the sensor is saturated."""


@dataclass(frozen=True)
class StillPose:
    """One pose, with means over the window."""

    measured: Array  # (3,) raw specific force, m/s^2, sensor axes
    up_b: Array | None  # (3,) unit, world z in body axes, by the tracker, or None
    deviation: float  # m/s^2, largest of the three axes


@dataclass(frozen=True)
class Stillness:
    """The progress of the present pose.

    Attributes:
        share: of the window, 0…1; back to 0 whenever the sensor moves.
        moving: what is too large at present, in words; empty when still.
    """

    share: float
    moving: str


class StillPoses:
    """Collects poses.

    Args:
        rate: Hz, of the samples.
        duration: s, of the window.
    """

    def __init__(self, rate: float, *, duration: float = 1.0) -> None:
        self.poses: list[StillPose] = []
        self._window = np.empty((max(2, round(rate * duration)), 3))
        self._ups = np.empty_like(self._window)
        self._with_up = 0
        self._count = 0
        self._taken: Array | None = None

    def add(
        self, measured: Array, angular_velocity_b: Array, up_b: Array | None = None
    ) -> Stillness:
        """Add one sample: (3,) m/s^2, (3,) rad/s without the drift, (3,) by the tracker's attitude.

        When it completes a pose, the pose is the last one of `poses`.
        """
        moving = self._moving(measured, angular_velocity_b)
        if moving:
            self._restart()
            return Stillness(0.0, moving)
        self._window[self._count] = measured
        if up_b is not None:
            self._ups[self._with_up] = up_b
            self._with_up += 1
        self._count += 1
        if self._count < len(self._window):
            return Stillness(self._count / len(self._window), "")
        mean, deviation = self._window.mean(axis=0), float(self._window.std(axis=0).max())
        if deviation > FORCE_DEVIATION_MAX:
            self._restart()
            limit = FORCE_DEVIATION_MAX
            return Stillness(0.0, f"it shakes by {deviation:.2f} m/s², allowed {limit:.2f}")
        direction = mean / np.linalg.norm(mean)
        if self._taken is None or direction @ self._taken < math.cos(APART):
            self._taken = direction
            self.poses.append(StillPose(mean, self._up(), deviation))
        self._restart()
        return Stillness(1.0, "")

    def _moving(self, measured: Array, angular_velocity_b: Array) -> str:
        turn = float(np.linalg.norm(angular_velocity_b))
        if not (np.isfinite(measured).all() and math.isfinite(turn)):
            return "the samples are not finite"
        if turn > TURN_MAX:
            return f"it turns at {math.degrees(turn):.1f} °/s, allowed {math.degrees(TURN_MAX):.1f}"
        largest = float(np.abs(measured).max())
        if largest >= SATURATION:
            return f"the accelerometer is saturated at {largest:.1f} m/s²"
        return ""

    def _up(self) -> Array | None:
        """Return the mean up by the tracker, or None when it was available for less than half of
        the time.
        """
        if 2 * self._with_up < self._count:
            return None
        mean = self._ups[: self._with_up].mean(axis=0)
        up: Array = mean / np.linalg.norm(mean)
        return up

    def _restart(self) -> None:
        self._count = self._with_up = 0
