"""Poses that successive frames of bearings give by themselves, compared with each other.

When such a run contradicts a filter, the filter is wrong, not the measurements: something mistaken
for a beacon in one frame is not mistaken again in the next.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from estimation.error_state.gate import RUN_DEVIATIONS, RUN_GAP, RUN_LEAST, RUN_RATE, RUN_SPEED
from estimation.error_state.start import DETERMINED, pose_of_bearings
from estimation.outcome import Outcome
from estimation.poses.planar_pose import PlanarPose
from quadrotor.errors import DegenerateGeometryError, MeasurementError
from quadrotor.records import Array
from quadrotor.rotations import norm, quaternion_conjugate, quaternion_log, quaternion_multiply


class FrameRun:
    """The newest frames, at most RUN_LEAST, each of which agrees with the previous one."""

    def __init__(self) -> None:
        self._poses: deque[tuple[int, PlanarPose]] = deque(maxlen=RUN_LEAST)

    @property
    def long_enough(self) -> bool:
        """Return whether enough frames agree for a filter to restart from them."""
        return len(self._poses) == RUN_LEAST

    def clear(self) -> None:
        self._poses.clear()

    def add(self, stamp_ns: int, pose: PlanarPose) -> None:
        """Add the pose of one frame; one that does not agree begins another run."""
        if self._poses and not _agree(*self._poses[-1], stamp_ns, pose):
            self._poses.clear()
        self._poses.append((stamp_ns, pose))

    def compare(self, frame: np.void, outcome: int, *, all_used: bool) -> None:
        """Compare a BEARINGS_SAMPLE item with the run, unless all its bearings were used."""
        if outcome == Outcome.APPLIED and all_used:
            self.clear()
        elif outcome in (Outcome.APPLIED, Outcome.OUTLIER) and frame["count"] >= DETERMINED:
            try:
                pose = pose_of_bearings(frame)
            except (DegenerateGeometryError, MeasurementError):
                self.clear()  # it contradicts itself
            else:
                self.add(int(frame["stamp_ns"]), pose)

    def velocity(self) -> tuple[Array, Array]:
        """Return the mean velocity (3,) along a run that is long enough, m/s, world axes, and its
        deviations (3,).
        """
        (began_ns, first), (now_ns, last) = self._poses[0], self._poses[-1]
        lasted = 1e-9 * (now_ns - began_ns)
        variance = np.diag(first.covariance)[:3] + np.diag(last.covariance)[:3]
        return (last.position_w - first.position_w) / lasted, np.sqrt(variance) / lasted


def _agree(before_ns: int, before: PlanarPose, now_ns: int, now: PlanarPose) -> bool:
    """Return whether a vehicle may have moved this way from one pose to the next."""
    t = 1e-9 * (now_ns - before_ns)
    turn = quaternion_multiply(now.quaternion_wb, quaternion_conjugate(before.quaternion_wb))
    moved = norm(now.position_w - before.position_w), norm(quaternion_log(turn))
    variance = (np.diag(before.covariance) + np.diag(now.covariance)).reshape(2, 3).sum(axis=1)
    return 0.0 < t <= RUN_GAP and all(
        apart < RUN_DEVIATIONS * math.sqrt(spread) + speed * t
        for apart, spread, speed in zip(
            moved, variance.tolist(), (RUN_SPEED, RUN_RATE), strict=True
        )
    )
