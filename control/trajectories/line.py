"""A line from rest to rest within bounds of velocity, acceleration and jerk, and a fixed point."""

from __future__ import annotations

import math

import numpy as np

from control.trajectories.phase_curve import PHASE_CURVE, sample_phase_curve
from control.trajectories.ramped_phase import RAMP_BEND, RAMP_SLOPE
from control.trajectories.trajectory import Stretch
from quadrotor.records import Record
from quadrotor.rotations import wrap_angle

RAMP_MIN = 0.3
"""Shortest ramp, in s: shorter ones need more snap than the motors can follow."""


class Line:
    """A straight line from `start` to `end`, turning the short way; C4, at rest at both ends.

    Velocity, acceleration and jerk stay within their bounds, and each is reached unless another one
    or RAMP_MIN prevents it. The time-optimal profile of seven constant jerks would be faster, but
    its jerk jumps; the torques follow snap, which here is continuous.

    Args:
        start, end: (x, y, z, yaw) in m and rad, world axes.
        speed, acceleration, jerk: bounds, m/s, m/s^2 and m/s^3, > 0.
        yaw_rate, yaw_acceleration: bounds, rad/s and rad/s^2, > 0.
    """

    def __init__(
        self,
        start: tuple[float, float, float, float],
        end: tuple[float, float, float, float],
        *,
        speed: float,
        acceleration: float,
        jerk: float = math.inf,
        yaw_rate: float = 1.0,
        yaw_acceleration: float = 2.0,
    ) -> None:
        change = [end[i] - start[i] for i in range(3)] + [wrap_angle(end[3] - start[3])]
        # In shares of the way: the slower of moving and turning sets the pace.
        distance, turn = max(math.hypot(*change[:3]), 1e-9), max(abs(change[3]), 1e-9)
        rate = min(speed / distance, yaw_rate / turn)
        steepest = min(acceleration / distance, yaw_acceleration / turn)
        bend = jerk / distance
        ramp = max(RAMP_SLOPE * rate / steepest, math.sqrt(RAMP_BEND * rate / bend), RAMP_MIN)
        if rate * ramp > 1.0:  # too short to reach the speed: two ramps, no cruise
            cubic = (RAMP_BEND / bend) ** (1.0 / 3.0)
            ramp = max(math.sqrt(RAMP_SLOPE / steepest), cubic, RAMP_MIN)
            rate = 1.0 / ramp
        self._line = np.zeros(1, PHASE_CURVE)
        none = (0.0, 0.0, 0.0)
        self._line[0] = (start, none, none, change, rate, ramp, 1.0)
        self._ramp = ramp
        self.duration = 1.0 / rate + ramp

    def sample(self, t: float, reference: Record) -> None:
        sample_phase_curve(self._line, t, reference, 0.0)

    def sample_grid(self, t: float, step: float, references: Record) -> None:
        sample_phase_curve(self._line, t, references, step)

    def stretches(self) -> tuple[Stretch, ...]:
        """Return both ramps: between them only the position changes."""
        end = self.duration
        return (0.0, self._ramp, 100), (end - self._ramp, end, 100)


class Hover:
    """A fixed point and yaw without end: a line of zero length.

    Args:
        position_w: (x, y, z) m.
        yaw: rad.
    """

    def __init__(self, position_w: tuple[float, float, float], yaw: float) -> None:
        self._line = np.zeros(1, PHASE_CURVE)
        self._line["center"] = (*position_w, yaw)
        self._line["rate"] = 1.0
        self._line["ramp"] = 1.0
        self._line["total"] = 1.0
        self.duration = float("inf")

    def sample(self, t: float, reference: Record) -> None:
        sample_phase_curve(self._line, t, reference, 0.0)
