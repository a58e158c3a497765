"""Trajectories from any motion to rest at a goal: the present motion fades while a line rises.

The sum of a stop (velocity polynomial of eighth order that matches velocity to snap) and a line
from the end of that stop. Both get half of the acceleration, so the sum keeps to the limit; and as
one fades while the other grows, a goal straight ahead is flown at an even speed. A single
polynomial of ninth order to the goal would overshoot in speed by half.
"""

from __future__ import annotations

import math

import numpy as np

from control.trajectories.line import Line
from control.trajectories.polynomial import Polynomial, hermite, motion_of
from control.trajectories.ramped_phase import RAMP_SLOPE
from quadrotor.records import Record, new_reference

STOP_MIN = 0.6
"""Shortest stop, in s: shorter ones need more snap than the motors can follow."""


def stop(start: Record, duration: float) -> tuple[Polynomial, tuple[float, float, float, float]]:
    """Return a polynomial from the motion of `start` to rest in `duration` s, and its end.

    The end (x, y, z, yaw) is the one that needs no ninth power: each axis' last coefficient is
    affine in it.
    """
    motion, rest = motion_of(start), np.zeros((4, 5))
    at_zero = hermite(motion, rest, duration)[:, 9]
    rest[:, 0] = 1.0
    slope = hermite(motion, rest, duration)[:, 9] - at_zero
    rest[:, 0] = -at_zero / slope
    x, y, z, yaw = rest[:, 0].tolist()
    coefficients = hermite(motion, rest, duration)
    return Polynomial(np.array([0.0, duration]), coefficients[None]), (x, y, z, yaw)


class Retarget:
    """A motion from the reference `start`, moving or not, to rest at `end`; turns the short way.

    Args:
        start: REFERENCE, shape (1,).
        end: (x, y, z, yaw) in m and rad.
        speed, acceleration, yaw_rate, yaw_acceleration: bounds, which `start` may already exceed.
    """

    def __init__(
        self,
        start: Record,
        end: tuple[float, float, float, float],
        *,
        speed: float,
        acceleration: float,
        yaw_rate: float,
        yaw_acceleration: float,
    ) -> None:
        present = math.hypot(*start["velocity_w"][0].tolist())
        turning = abs(float(start["yaw_rate"][0]))
        slowing = max(present / acceleration, turning / yaw_acceleration)
        self._stop, at = stop(start, max(2.0 * RAMP_SLOPE * slowing, STOP_MIN))
        x, y, z, yaw = (end[i] - at[i] for i in range(4))
        self._line = Line(
            (0.0, 0.0, 0.0, 0.0),
            (x, y, z, yaw),
            speed=speed,
            acceleration=0.5 * acceleration,
            yaw_rate=yaw_rate,
            yaw_acceleration=0.5 * yaw_acceleration,
        )
        self._shift = new_reference()
        self.duration = max(self._stop.duration, self._line.duration)

    def sample(self, t: float, reference: Record) -> None:
        self._stop.sample(t, reference)
        self._line.sample(t, self._shift)
        floats = reference.view("f8")
        floats += self._shift.view("f8")
