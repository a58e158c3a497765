"""The poses that fit the observed tags of a body, or of the world."""

from __future__ import annotations

import numpy as np

from estimation.tags.detector import Tags
from estimation.tags.intrinsics import Intrinsics
from estimation.tags.tag_layout import TagPlace
from estimation.tags.tag_pose import TagPose, poses_of
from quadrotor.errors import MeasurementError

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
            f"{what} do not fit where they are seen: {left}, allowed {allowed:g}; the "
            "intrinsics are of another camera, or their sizes and places are wrong"
        )
    return poses
