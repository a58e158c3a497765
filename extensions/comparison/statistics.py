"""Errors of states relative to a true pose; their rms and maximum over 10 s and the session."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bearing_sim.pose_track import Pose
from quadrotor.records import Array

RECENT_NS = 10_000_000_000
KEPT = 1200
"""Number of errors kept: those of RECENT_NS at the 100 a second that are compared, and
a reserve."""
POSITION, VELOCITY, QUATERNION, RATE = slice(0, 3), slice(3, 6), slice(6, 10), slice(10, 13)
"""Columns of a STATE laid out as 13 numbers."""


def errors(states: Array, true: Pose) -> list[tuple[float, float]]:
    """Return the errors, m and rad, of states (E, 13) with unit quaternions; NaN for NaN.

    On plain numbers, as numpy takes longer for so few.
    """
    position, quaternion = list(map(float, true.position_w)), list(map(float, true.quaternion_wb))
    found = []
    for state in states.tolist():
        q = state[QUATERNION]
        # By the chord between quaternions: the arc cosine of their product loses small angles.
        apart, sum_ = math.dist(q, quaternion), math.dist(q, [-x for x in quaternion])
        half = 0.5 * min(apart, sum_)
        angle = 2.0 * math.pi if half >= 1.0 else 4.0 * math.asin(half)
        found.append((math.dist(state[POSITION], position), angle))
    return found


class Summary(NamedTuple):
    """Rms and maximum of position (m) and attitude (rad) errors; NaN without errors."""

    position_rms: float
    position_max: float
    attitude_rms: float
    attitude_max: float


NOTHING = Summary(math.nan, math.nan, math.nan, math.nan)


class ErrorStatistics:
    """The error statistics of one estimator."""

    def __init__(self) -> None:
        self._stamps = np.full(KEPT, -(1 << 62), np.int64)
        self._errors = np.zeros((KEPT, 2))
        self._place = 0
        self.begin()

    def begin(self) -> None:
        """Begin a session with the next error; the last 10 s are kept."""
        self._count = 0
        self._squares = [0.0, 0.0]
        self._largest = [0.0, 0.0]
        self._first_ns = self._last_ns = 0

    def add(self, stamp_ns: int, position: float, attitude: float, counts: bool = True) -> None:
        """Add one error: m, rad. It is not part of the session when `counts` is False; NaN is
        ignored.
        """
        if not (math.isfinite(position) and math.isfinite(attitude)):
            return
        k, self._place = self._place, (self._place + 1) % KEPT
        self._stamps[k], self._errors[k] = stamp_ns, (position, attitude)
        if not counts:
            return
        if not self._count:
            self._first_ns = stamp_ns
        self._count, self._last_ns = self._count + 1, stamp_ns
        for j, value in enumerate((position, attitude)):
            self._squares[j] += value * value
            self._largest[j] = max(self._largest[j], value)

    @property
    def duration(self) -> float:
        """Return the seconds between the first and the newest error of the session."""
        return 1e-9 * (self._last_ns - self._first_ns)

    def session(self) -> Summary:
        if not self._count:
            return NOTHING
        rms = [math.sqrt(square / self._count) for square in self._squares]
        return Summary(rms[0], self._largest[0], rms[1], self._largest[1])

    def recent(self, now_ns: int) -> Summary:
        """Return the summary of the 10 s before `now_ns`."""
        inside = self._errors[(self._stamps > now_ns - RECENT_NS) & (self._stamps <= now_ns)]
        if not len(inside):
            return NOTHING
        rms = np.sqrt((inside**2).mean(axis=0)).tolist()
        largest = inside.max(axis=0).tolist()
        return Summary(rms[0], largest[0], rms[1], largest[1])
