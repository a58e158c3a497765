"""Poses of points with known places on a body, from their pixels.

Starts: T. Collins and A. Bartoli, "Infinitesimal plane-based pose estimation" (2014), which gives
both possible poses of a flat target, and G. Terzakis and M. Lourakis, "A consistently fast and
globally optimal solution to the perspective-n-point problem" (2020) for points that are not in one
plane. Each is refined by least squares on the pixels, through the lens's distortion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from extensions.vision.tags.detector import Tags
from extensions.vision.tags.intrinsics import Intrinsics
from extensions.vision.tags.tag_layout import TagPlace
from quadrotor.errors import MeasurementError
from quadrotor.records import Array
from quadrotor.rotations import hat, rotation_exp, rotation_log

FLAT = 1e-3
"""Share of the extent by which points may leave a plane and still count as coplanar."""
NOISE = 0.05
"""Noise of the corners of `TagDetector`, in pixels on each axis, for any blur of the lens."""
CLEARLY = 9.0
"""Variances of the corner noise by which squared residuals must differ for one pose of a flat
target to be clearly better than the other."""


@dataclass(frozen=True, eq=False)
class TagPose:
    """A body's pose in camera axes: x right, y down in the picture, z forward.

    Attributes:
        position_c: (3,) m.
        R_cb: (3, 3).
        residual: rms distance of the pixels from those of the pose, pixels.
        points_b: (N, 3) m, from which it was found.
        lens: of the camera.
    """

    position_c: Array
    R_cb: Array
    residual: float
    points_b: Array
    lens: Intrinsics

    @cached_property
    def information(self) -> Array:
        """Return J^T J (6, 6), for corner noise of 1 pixel on each axis.

        Order: position_c, m; then the rotation vector of a turn in body axes, rad. Its inverse
        times the noise's variance is the pose's covariance and the Cramér–Rao bound.
        """
        import cv2

        turned = self.points_b @ self.R_cb.T
        zero = np.zeros(3)
        _, slopes = cv2.projectPoints(
            turned + self.position_c, zero, zero, self.lens.matrix, self.lens.distortion
        )
        along = slopes[:, 3:6].reshape(-1, 2, 3)
        levers = np.stack([-self.R_cb @ hat(p) for p in self.points_b])
        J = np.concatenate([along, along @ levers], axis=2).reshape(-1, 6)
        found: Array = J.T @ J
        return found


def poses_of(points_b: Array, pixels: Array, lens: Intrinsics) -> list[TagPose]:
    """Return the poses that fit, smallest residual first: usually two for a flat target; none when
    the solver finds none in front of the camera.

    Args:
        points_b: (N, 3) m, N >= 4.
        pixels: (N, 2).
    """
    import cv2

    K, distortion = lens.matrix, lens.distortion
    # OpenCV's solver of flat targets is wrong for points that are not about their middle.
    middle = points_b.mean(axis=0)
    points = points_b - middle
    spread = np.linalg.svd(points, compute_uv=False)
    method = cv2.SOLVEPNP_IPPE if spread[2] < FLAT * spread[0] else cv2.SOLVEPNP_SQPNP
    _, turns, places, _ = cv2.solvePnPGeneric(points, pixels, K, distortion, flags=method)
    found = []
    for start in zip(turns, places, strict=True):
        turn, place = cv2.solvePnPRefineLM(points, pixels, K, distortion, *start)
        seen, _ = cv2.projectPoints(points, turn, place, K, distortion)
        residual = math.sqrt(float(((seen[:, 0] - pixels) ** 2).sum(axis=1).mean()))
        R_cb = rotation_exp(np.asarray(turn[:, 0], float))
        position_c = np.asarray(place[:, 0], float) - R_cb @ middle
        if math.isfinite(residual) and (points_b @ R_cb[2] + position_c[2]).min() > 0.0:
            found.append(TagPose(position_c, R_cb, residual, points_b, lens))
    return sorted(found, key=lambda pose: pose.residual)


def likeliest(poses: list[TagPose], R_cb: Array) -> TagPose:
    """Return the pose nearest in attitude to R_cb (3, 3), among the poses that fit as well as the
    first.

    Args:
        poses: from `poses_of`, not empty.
    """
    best = poses[0]

    def as_good(pose: TagPose) -> bool:
        more = len(best.points_b) * (pose.residual**2 - best.residual**2)
        return more <= CLEARLY * NOISE * NOISE

    return min(filter(as_good, poses), key=lambda p: np.linalg.norm(rotation_log(R_cb.T @ p.R_cb)))


STILL_RESIDUAL_MAX, RESIDUAL_MAX = 0.5, 1.0
"""Largest residual of a pose, in pixels: of the camera, and of a body in motion."""


def fitting(
    what: str, places: dict[int, TagPlace], tags: Tags, lens: Intrinsics, allowed: float
) -> list[TagPose]:
    """Return the poses of tags with known places, best first; none when no tag is seen.

    Raises MeasurementError when none fits.
    """
    seen = [number for number in places if number in tags]
    if not seen:
        return []
    points = np.concatenate([places[number].corners for number in seen])
    poses = poses_of(points, np.concatenate([tags[number] for number in seen]), lens)
    if not poses or poses[0].residual > allowed:
        left = f"{poses[0].residual:.1f} pixels are left" if poses else "there is no pose"
        raise MeasurementError(
            f"{what} do not fit where they are seen: {left}, allowed {allowed:g}; calibrate the "
            "camera in Settings, or correct their sizes and places"
        )
    return poses
