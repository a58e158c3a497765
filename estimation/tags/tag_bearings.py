"""Bearings to beacons that are tags, in the pictures of a camera on the vehicle.

A bearing is given from the body's origin, not from the lens: the tag's size gives its distance, so
that its centre can be transformed from the camera's axes to the body's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from estimation.tags.detector import DEFAULT_FAMILY, Picture, TagDetector, Tags
from estimation.tags.intrinsics import Intrinsics
from estimation.tags.tag_layout import Size, Strict, TagPlace, Triple, read_tags
from estimation.tags.tag_pose import NOISE, RESIDUAL_MAX, TagPose, fitting, poses_of
from quadrotor.records import MAX_BEACONS, Array
from quadrotor.rotations import quaternion_from_euler, quaternion_to_matrix

DOWN = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""R_bc of a camera that looks along the body's -z, with the top of its picture forward."""
LEAST = 4
"""Minimum number of beacons in a picture that shows whether they fit their places."""


class Mount(Strict):
    """A camera on the vehicle."""

    position: Triple = (0.0, 0.0, 0.0)
    turn: Triple = (0.0, 0.0, 0.0)

    @property
    def axes_b(self) -> Array:
        """Return R_bc: columns are the camera's x right, y down in the picture, z forward."""
        return np.asarray(
            quaternion_to_matrix(quaternion_from_euler(*np.radians(self.turn))) @ DOWN
        )


class BeaconTags(Strict):
    """The camera and its tags, from a TOML file.

    Attributes:
        size: of the tags, m.
        sizes: of those of another size.
        delay: s, from the middle of the exposure to the driver's stamp.
        sigma: deg, of errors that the corners do not show: stamps, the camera's axes, places of
            tags.
    """

    size: Size
    sizes: dict[int, Size] = Field(default_factory=dict)
    family: str = DEFAULT_FAMILY
    sigma: Annotated[float, Field(ge=0.01, le=20.0)] = 0.2
    delay: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    camera: Mount = Mount()


class Sighting(NamedTuple):
    """The beacons in one picture: ids, unit vectors (N, 3) in body axes, rad on each of two tangent
    axes, and the pixels (N, 2) of their centres.
    """

    beacon_ids: list[int]
    bearings_b: Array
    sigma: float
    pixels: Array


def load_beacon_tags(path: Path) -> BeaconTags:
    """Return the content of a file. Raises StorageError, MeasurementError."""
    return read_tags(path, BeaconTags)


class TagBearings:
    """Finds the beacons in pictures. Raises MeasurementError for an unknown family.

    Attributes:
        tags: those in the newest picture.
    """

    def __init__(self, tags: BeaconTags, lens: Intrinsics) -> None:
        self._told, self._lens = tags, lens
        self._detector = TagDetector(lens, tags.family)
        self.tags: Tags = {}
        self._R_bc, self._lens_b = tags.camera.axes_b, np.array(tags.camera.position)

    def take(self, grey: Picture) -> Sighting:
        """Return the beacons in a picture. Raises MeasurementError when the picture, a tag in it or
        the intrinsics are wrong.
        """
        self.tags = {}
        self.tags = self._detector.tags(grey)
        return self.seen(self.tags)

    def seen(self, tags: Tags) -> Sighting:
        """Return the bearings to tags, at most as many as a frame holds. Raises MeasurementError
        when one does not fit.
        """
        ids = sorted(tags)[:MAX_BEACONS]
        poses = [self._pose(number, tags) for number in ids]
        places_b = [self._lens_b + self._R_bc @ pose.position_c for pose in poses]
        # All bearings of a frame have one deviation: that of the worst corner noise.
        corner = max(map(self._deviation, poses, places_b), default=0.0)
        centres = np.array([pose.position_c for pose in poses]).reshape(-1, 3)
        return Sighting(
            ids,
            np.array([p / np.linalg.norm(p) for p in places_b]).reshape(-1, 3),
            math.hypot(corner, math.radians(self._told.sigma)),
            _pixels(centres, self._lens),
        )

    def misfit(self, seen: Sighting, places_w: Mapping[int, Sequence[float] | Array]) -> float:
        """Return the deviation of beacons from their places, pixels rms, for the camera pose that
        fits best; NaN when too few of them are seen.
        """
        known = [k for k, number in enumerate(seen.beacon_ids) if number in places_w]
        if len(known) < LEAST:
            return math.nan
        places = np.array([places_w[seen.beacon_ids[k]] for k in known], float)
        poses = poses_of(places, seen.pixels[known], self._lens)
        return poses[0].residual if poses else math.inf

    def _pose(self, number: int, tags: Tags) -> TagPose:
        size = self._told.sizes.get(number, self._told.size)
        place = {number: TagPlace(size=size, position=(0.0, 0.0, 0.0))}
        poses = fitting(f"the corners of tag {number}", place, tags, self._lens, RESIDUAL_MAX)
        return poses[0]

    def _deviation(self, pose: TagPose, place_b: Array) -> float:
        """Return the deviation of a bearing on each of two tangent axes, from the corner noise."""
        covariance = NOISE**2 * np.linalg.inv(pose.information)[:3, :3]
        far = float(np.linalg.norm(place_b))
        along = self._R_bc.T @ place_b / far
        across = float(np.trace(covariance) - along @ covariance @ along)
        return math.sqrt(0.5 * max(0.0, across)) / far


def _pixels(points_c: Array, lens: Intrinsics) -> Array:
    import cv2

    if not len(points_c):
        return np.empty((0, 2))
    zero = np.zeros(3)
    pixels, _ = cv2.projectPoints(points_c, zero, zero, lens.matrix, lens.distortion)
    return np.asarray(pixels[:, 0], float)
