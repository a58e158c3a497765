"""One pose of a body from several cameras, whose pictures need not be taken together.

Each camera's pose comes with its covariance. It is combined with the other cameras' newest poses,
carried to its time by their last motion, as Gaussian measurements are: weighted by their inverse
covariances. Nothing else is remembered, so the result is as independent from the past as a pose of
one camera is.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from quadrotor.records import Array
from quadrotor.rotations import (
    quaternion_from_matrix,
    quaternion_to_matrix,
    rotation_exp,
    rotation_log,
)

SPACING, AHEAD = 0.25, 1.5
"""Longest time in s between two poses of a camera from which a third is carried, and how far, in
these times."""
ACCELERATION, TURNING = 3.0, 10.0
"""Standard deviation of the accelerations that a carried pose misses, m/s² and rad/s²."""
PLACE_OFF, PLACE_TURNED = 0.002, 0.001
"""Standard deviation of a camera's own place, m and rad, which noise of the corners does not show.
"""
FAR_OFF, FAR_TURNED = 0.15, math.radians(25.0)
"""Limits beyond which a camera's pose is left out."""
APART, TURNED = 0.02, math.radians(2.0)
"""Limits of the median difference of two cameras beyond which they disagree, m and rad."""
JUDGED, ENOUGH = 60, 20
"""Number of differences in the median, and the smallest one."""
BREAK = 0.5
"""Seconds without a pose of a camera after which its past does not count."""


class BodyPose(NamedTuple):
    """A body's pose in the world, as one camera sees it.

    Attributes:
        position_w: (3,) m. quaternion_wb: (4,).
        covariance: (6, 6) of the position, m, and of a turn in body axes, rad.
    """

    position_w: Array
    quaternion_wb: Array
    covariance: Array


class Disagreement(NamedTuple):
    """The disagreement of two cameras on a body: median distance in m, and turn in rad."""

    cameras: tuple[int, int]
    apart: float
    turned: float


class _Track:
    """The newest poses of one camera, and when its unbroken series began."""

    def __init__(self) -> None:
        self.poses: deque[tuple[int, BodyPose]] = deque(maxlen=2)
        self.since_ns = 0

    def add(self, stamp_ns: int, pose: BodyPose) -> None:
        """Add a pose; a jump or a break begins a new series."""
        carried = self.carried(stamp_ns)
        broken = not self.poses or stamp_ns - self.poses[-1][0] > BREAK * 1e9
        if broken or (carried is not None and _are_far(carried, pose)):
            self.poses.clear()
            self.since_ns = stamp_ns
        self.poses.append((stamp_ns, pose))

    def carried(self, stamp_ns: int) -> BodyPose | None:
        """Return the pose at a time, None when the last ones are too old or too few."""
        if len(self.poses) < 2:
            return None
        (first_ns, first), (last_ns, last) = self.poses
        spacing, past = 1e-9 * (last_ns - first_ns), 1e-9 * (stamp_ns - last_ns)
        if not (0.0 < spacing < SPACING and 0.0 <= past <= AHEAD * spacing):
            return None
        ahead = past / spacing
        R_first, R_last = map(quaternion_to_matrix, (first.quaternion_wb, last.quaternion_wb))
        turn = rotation_log(R_first.T @ R_last)
        missed = 0.5 * past * (past + spacing)  # s^2: by a constant acceleration
        noise = (1.0 + ahead) ** 2 * last.covariance + ahead**2 * first.covariance
        off = np.repeat([ACCELERATION * missed, TURNING * missed], 3)
        return BodyPose(
            last.position_w + ahead * (last.position_w - first.position_w),
            quaternion_from_matrix(R_last @ rotation_exp(ahead * turn)),
            noise + np.diag(off**2),
        )


class CameraFusion:
    """Fuses the poses of one body; they are given in the order of their time.

    Args:
        count: number of cameras.

    Attributes:
        left_out: the cameras whose newest pose was left out.
    """

    def __init__(self, count: int) -> None:
        self.left_out: set[int] = set()
        self._tracks = [_Track() for _ in range(count)]
        self._differences: dict[tuple[int, int], deque[Array]] = {}

    def take(self, camera: int, stamp_ns: int, pose: BodyPose) -> BodyPose | None:
        """Return the pose at this time from all cameras; None when this camera's pose is far from
        that of one that has been seeing the body for longer.
        """
        own = self._tracks[camera]
        own.add(stamp_ns, pose)
        self.left_out.discard(camera)
        used = [pose]
        for number, track in enumerate(self._tracks):
            other = None if number == camera else track.carried(stamp_ns)
            if other is None:
                continue
            self._note(camera, number, pose, other)
            if not _are_far(pose, other):
                if number not in self.left_out:
                    used.append(other)
            elif track.since_ns <= own.since_ns and number not in self.left_out:
                self.left_out.add(camera)
        return None if camera in self.left_out else _combined(used)

    def disagreements(self) -> list[Disagreement]:
        """Return the pairs of cameras that disagree, by their last poses."""
        found = []
        for cameras, differences in self._differences.items():
            if len(differences) < ENOUGH:
                continue
            middle = np.median(np.array(differences), axis=0)
            apart, turned = map(float, map(np.linalg.norm, (middle[:3], middle[3:])))
            if apart > APART or turned > TURNED:
                found.append(Disagreement(cameras, apart, turned))
        return found

    def _note(self, camera: int, number: int, pose: BodyPose, other: BodyPose) -> None:
        lower, higher = (pose, other) if camera < number else (other, pose)
        pair = min(camera, number), max(camera, number)
        listed = self._differences.setdefault(pair, deque(maxlen=JUDGED))
        listed.append(_difference(lower, higher))


def _difference(one: BodyPose, other: BodyPose) -> Array:
    """Return (6,): how the other's position, m, and attitude, rad in the body's axes, differ."""
    R = quaternion_to_matrix(one.quaternion_wb)
    turn = rotation_log(R.T @ quaternion_to_matrix(other.quaternion_wb))
    return np.concatenate([other.position_w - one.position_w, turn])


def _are_far(one: BodyPose, other: BodyPose) -> bool:
    off = _difference(one, other)
    return bool(np.linalg.norm(off[:3]) > FAR_OFF or np.linalg.norm(off[3:]) > FAR_TURNED)


def _combined(poses: Sequence[BodyPose]) -> BodyPose:
    """Return the mean of poses that are near each other, weighted by their information."""
    place = np.diag(np.repeat([PLACE_OFF**2, PLACE_TURNED**2], 3))
    first, whole, moves = poses[0], np.zeros((6, 6)), np.zeros(6)
    for pose in poses:
        information = np.linalg.inv(pose.covariance + place)
        whole += information
        moves += information @ _difference(first, pose)
    covariance = np.asarray(np.linalg.inv(whole), np.float64)
    step = covariance @ moves
    R = quaternion_to_matrix(first.quaternion_wb) @ rotation_exp(step[3:])
    return BodyPose(first.position_w + step[:3], quaternion_from_matrix(R), covariance)
