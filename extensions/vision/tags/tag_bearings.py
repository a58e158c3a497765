"""Bearings to beacons that are tags, in the pictures of a camera on the vehicle.

A bearing is given from the body's origin, not from the lens: the tag's size gives its distance, so
that its centre can be transformed from the camera's axes to the body's.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

import numpy as np

from console.trackers.source import Sighting
from extensions.vision.tags.beacon_markers import BeaconMarkers
from extensions.vision.tags.detector import Picture, TagDetector, Tags
from extensions.vision.tags.intrinsics import Intrinsics
from extensions.vision.tags.tag_layout import TagPlace
from extensions.vision.tags.tag_pose import NOISE, RESIDUAL_MAX, TagPose, fitting, poses_of
from quadrotor.records import MAX_BEACONS, Array

Places = Mapping[int, Sequence[float] | Array]
"""Positions of beacons by id, (3,) m, world axes."""

LEAST = 4
"""Minimum number of beacons in a picture that shows whether they fit their places."""


class BearingReader(ABC):
    """Finds the beacons in pictures.

    Attributes:
        tags: corners of the markers in the newest picture, for people.
        doubt: a warning about the newest picture, which is still used.
    """

    def __init__(self, markers: BeaconMarkers, lens: Intrinsics) -> None:
        self._told, self._lens = markers, lens
        self._R_bc, self._lens_b = markers.camera.axes_b, np.array(markers.camera.position)
        self.tags: Tags = {}
        self.doubt = ""

    @abstractmethod
    def take(
        self,
        grey: Picture,
        taken_ns: int = 0,
        places_w: Places | None = None,
        position_w: Array | None = None,
    ) -> Sighting:
        """Return the beacons in a picture. Raises MeasurementError when the picture, a marker in it
        or the intrinsics are wrong.

        Args:
            taken_ns: its time, of any epoch.
            places_w: of the beacons, (3,) m each, as far as they are known.
            position_w: (3,) m, of the vehicle by its estimate, if it is known.
        """

    def misfit(self, seen: Sighting, places_w: Places) -> float:
        """Return the deviation of beacons from their places, pixels rms, for the camera pose that
        fits best; NaN when too few of them are seen.
        """
        known = [k for k, number in enumerate(seen.beacon_ids) if number in places_w]
        if len(known) < LEAST:
            return math.nan
        places = np.array([places_w[seen.beacon_ids[k]] for k in known], float)
        poses = poses_of(places, seen.pixels[known], self._lens)
        return poses[0].residual if poses else math.inf


class TagBearings(BearingReader):
    """Finds tags. Raises MeasurementError for an unknown family."""

    def __init__(self, markers: BeaconMarkers, lens: Intrinsics) -> None:
        super().__init__(markers, lens)
        assert markers.size is not None
        self._detector, self._size = TagDetector(lens, markers.family), markers.size

    def take(
        self,
        grey: Picture,
        taken_ns: int = 0,
        places_w: Places | None = None,
        position_w: Array | None = None,
    ) -> Sighting:
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
            self._lens.project(centres),
        )

    def _pose(self, number: int, tags: Tags) -> TagPose:
        size = self._told.sizes.get(number, self._size)
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
