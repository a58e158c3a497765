"""Detection of a tracked body that is turned about the vertical relative to the vehicle.

At rest on level ground the turn cannot be seen: gravity is the same whichever way the body's x axis
points. Tilted in the hand, gravity leans to one side of the vehicle by the accelerometer, and to
one side of the body by the tracker; the turn of the body is the angle between the two. The last
result holds until the vehicle is tilted again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy.typing as npt

from quadrotor.plain_rotations import rows_of

LEAST_TILT = math.radians(10.0)
SLOW, HELD = math.radians(20.0), 0.3
"""Limits in rad/s and s: when the vehicle is held this still for this long, the accelerometer shows
gravity and the estimate has followed the tracker."""
HAND = 0.1
"""Share of its length by which the specific force may change in a hand."""

Vector = Sequence[Any] | npt.NDArray[Any]


class BodyTurn:
    """Watches one vehicle's tracked body on the ground.

    Attributes:
        angle: rad, of the tracked body about the vertical relative to the vehicle; None if the
            vehicle was never tilted.
    """

    def __init__(self) -> None:
        self.angle: float | None = None
        self._since: float | None = None
        self._force = 0.0

    def update(self, now: float, quaternion_wb: Vector, rates_b: Vector, force_b: Vector) -> None:
        """Handle the newest tick of a disarmed vehicle.

        Args:
            now: s, steady.
            quaternion_wb: (4,) estimated attitude, which follows the tracker.
            rates_b: (3,) rad/s.
            force_b: (3,) m/s², specific force.
        """
        ahead, left, up = (float(axis) for axis in rows_of([float(x) for x in quaternion_wb])[2])
        x, y, z = (float(value) for value in force_b)
        force = math.hypot(x, y, z)
        is_steady = abs(force - self._force) < HAND * force
        is_held = is_steady and math.hypot(*map(float, rates_b)) < SLOW
        leaning = min(math.hypot(ahead, left), math.hypot(x, y) / max(force, 1e-9))
        if not (is_held and leaning > math.sin(LEAST_TILT) and min(up, z) > 0.0):
            self._since, self._force = None, force
            return
        if self._since is None:
            self._since = now
        if now - self._since >= HELD:
            self.angle = math.remainder(math.atan2(y, x) - math.atan2(left, ahead), math.tau)
