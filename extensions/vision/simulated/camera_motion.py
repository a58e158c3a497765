"""The motion of the simulated vehicle at the instants of a camera's pictures."""

from __future__ import annotations

import numpy as np

from bearing_sim.pose_track import PoseTrack
from quadrotor.records import Array
from quadrotor.rotations import quaternion_to_matrix, rotation_log


class CameraMotion:
    """Stores true poses, and interpolates between them.

    Attributes:
        velocity_w, turning_b: m/s and rad/s, between the two newest poses.
    """

    def __init__(self) -> None:
        self._track = PoseTrack()
        self._last: tuple[int, Array, Array] | None = None
        self.velocity_w = self.turning_b = np.zeros(3)

    def add(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> int | None:
        """Add a true pose; return the stamp from which on poses are known, None at the first."""
        after_ns = self._track.add(stamp_ns, position_w, quaternion_wb)
        R_wb, last = quaternion_to_matrix(quaternion_wb), self._last
        self._last = stamp_ns, position_w.copy(), R_wb
        if after_ns is None or last is None:
            return None
        seconds = 1e-9 * (stamp_ns - last[0])
        self.velocity_w = (position_w - last[1]) / seconds
        self.turning_b = rotation_log(last[2].T @ R_wb) / seconds
        return after_ns

    def at(self, stamp_ns: int) -> tuple[Array, Array]:
        """Return position (3,) in m and rotation matrix R_wb (3, 3) at an instant in between."""
        pose = self._track.at(stamp_ns)
        return np.array(pose.position_w), quaternion_to_matrix(np.array(pose.quaternion_wb))
