"""A straight line from rest to rest, within bounds of velocity and acceleration."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from control.trajectories.ramped_phase import RAMP_SLOPE, ramped_phase
from quadrotor.compiled import compiled
from quadrotor.records import Record
from quadrotor.rotations import wrap_angle

Array = npt.NDArray[np.float64]

RAMP_MIN = 0.3
"""s: shorter ramps ask for more snap than the motors follow."""

LINE = np.dtype(
    [
        ("start", "f8", 4),  # m, m, m, rad
        ("change", "f8", 4),  # m, m, m, rad
        ("rate", "f8"),  # 1/s, of the share flown
        ("ramp", "f8"),  # s
    ],
    align=True,
)


@compiled
def sample_line(line: Record, t: float, reference: Record) -> None:
    """The reference at t (s) on line[0], into reference[0]; both shape (1,)."""
    a = line[0]
    r = reference[0]
    s = np.empty(5)
    ramped_phase(t, a.rate, a.ramp, 1.0, s)
    for i in range(3):
        d = a.change[i]
        r.position_w[i] = a.start[i] + d * s[0]
        r.velocity_w[i] = d * s[1]
        r.acceleration_w[i] = d * s[2]
        r.jerk_w[i] = d * s[3]
        r.snap_w[i] = d * s[4]
    r.yaw = a.start[3] + a.change[3] * s[0]
    r.yaw_rate = a.change[3] * s[1]
    r.yaw_acceleration = a.change[3] * s[2]


class Line:
    """From `start` to `end`, turning the short way; C4, at rest at both ends.

    Args:
        start, end: (x, y, z, yaw) in m and rad, world axes.
        speed, acceleration: bounds, m/s and m/s^2, > 0.
        yaw_rate, yaw_acceleration: bounds, rad/s and rad/s^2, > 0.
    """

    def __init__(
        self,
        start: tuple[float, float, float, float],
        end: tuple[float, float, float, float],
        *,
        speed: float,
        acceleration: float,
        yaw_rate: float = 1.0,
        yaw_acceleration: float = 2.0,
    ) -> None:
        change = [end[i] - start[i] for i in range(3)] + [wrap_angle(end[3] - start[3])]
        # In shares of the way: the slower of moving and turning sets the pace.
        distance, turn = max(math.hypot(*change[:3]), 1e-9), max(abs(change[3]), 1e-9)
        rate = min(speed / distance, yaw_rate / turn)
        steepest = min(acceleration / distance, yaw_acceleration / turn)
        ramp = max(RAMP_SLOPE * rate / steepest, RAMP_MIN)
        if rate * ramp > 1.0:  # too short to reach the speed: two ramps, no cruise
            ramp = max(math.sqrt(RAMP_SLOPE / steepest), RAMP_MIN)
            rate = 1.0 / ramp
        self._line = np.zeros(1, LINE)
        self._line["start"] = start
        self._line["change"] = change
        self._line["rate"] = rate
        self._line["ramp"] = ramp
        self.duration = 1.0 / rate + ramp

    def sample(self, t: float, reference: Record) -> None:
        sample_line(self._line, t, reference)
