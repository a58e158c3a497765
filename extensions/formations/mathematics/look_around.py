"""A path that looks around, planned before it is flown: a trajectory of `follow_trajectory`.

It is the path that `LookAround` plans step by step for a vehicle whose estimate is as good as its
bearings allow, so that each plan begins with the information that the path before has given. It is
flown as a B-spline of degree 7 of the same control points: it lies in their convex hull too, so
that it keeps to the same limits, and it is smooth up to the snap.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from extensions.formations.mathematics.active_sensing import (
    SAMPLES,
    STEP,
    LookAround,
    Room,
    Sights,
    carried,
    gramian,
)
from quadrotor.errors import DegenerateGeometryError
from quadrotor.records import Array, Record

DEGREE = 7
START = np.diag([0.3, 0.3, 0.3, math.radians(10.0)]) ** 2
"""Covariance of place (m) and yaw (rad) at the start."""
SHORTEST, LONGEST = 5.0, 600.0
"""s"""
DERIVATIVES = ("position_w", "velocity_w", "acceleration_w", "jerk_w", "snap_w")


class LookAroundPath:
    """A trajectory with the yaw of its start, at rest at both ends.

    Args:
        duration: s, rounded to STEP.

    Raises DegenerateGeometryError for a duration that is too short or long.
    """

    def __init__(
        self,
        room: Room,
        sights: Sights,
        duration: float,
        covariance: npt.ArrayLike = START,
        yaw: float = 0.0,
    ) -> None:
        if not SHORTEST <= duration <= LONGEST:
            raise DegenerateGeometryError(
                f"duration is {duration:g} s; allowed {SHORTEST:g} to {LONGEST:g} s"
            )
        from scipy.interpolate import BSpline

        steps = round(duration / STEP) - DEGREE - 1
        points = planned_points(room, sights, steps, covariance)
        control = np.array([*[points[0]] * DEGREE, *points, *[points[-1]] * DEGREE])
        self.duration = (len(control) - DEGREE) * STEP
        knots = STEP * (np.arange(len(control) + DEGREE + 1.0) - DEGREE)
        spline = BSpline(knots, control, DEGREE)
        self._derivatives = [spline.derivative(order) for order in range(len(DERIVATIVES))]
        self._yaw = yaw

    def sample(self, t: float, reference: Record) -> None:
        """Fill the whole reference for t in s since the start; the ends are held."""
        at = min(max(t, 0.0), self.duration)
        for name, derivative in zip(DERIVATIVES, self._derivatives, strict=True):
            reference[name] = derivative(at)
        reference["yaw"], reference["yaw_rate"], reference["yaw_acceleration"] = self._yaw, 0.0, 0.0


def planned_points(
    room: Room, sights: Sights, steps: int, covariance: npt.ArrayLike
) -> list[Array]:
    """Return the control points of a path from rest in the centre, planned anew at each step."""
    plan, information = LookAround(room, sights), np.linalg.inv(np.asarray(covariance, dtype=float))
    times = np.linspace(0.0, STEP, SAMPLES + 1)
    points = [plan.points_w[0]]
    for _ in range(steps):
        plan.plan(np.linalg.inv(information))
        path = plan.at(times)[0]
        information = carried(information, path[-1] - path[0], STEP, sights) + gramian(
            path[1:], times[1:], sights
        )
        plan.advance()
        points.append(plan.points_w[0])
    return points
