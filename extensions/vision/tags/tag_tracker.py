"""Bodies' poses in the world, picture by picture, from one fixed camera."""

from __future__ import annotations

import math

import numpy as np

from extensions.vision.tags.camera_fusion import BodyPose
from extensions.vision.tags.detector import Picture, TagDetector, Tags
from extensions.vision.tags.intrinsics import Intrinsics
from extensions.vision.tags.tag_layout import CameraPlace, TagLayout, TagPlace
from extensions.vision.tags.tag_pose import (
    NOISE,
    RESIDUAL_MAX,
    STILL_RESIDUAL_MAX,
    TagPose,
    fitting,
    likeliest,
)
from quadrotor.errors import MeasurementError
from quadrotor.records import Array
from quadrotor.rotations import quaternion_from_matrix

PLACED_OVER = 30
"""Number of pictures over which the tags of the world are averaged to locate the camera."""
MOVED = 2.0
"""Pixels by which the tags of the world may deviate from their places."""
REMEMBERED = 15
"""Number of pictures without a body after which its last attitude is ignored."""


class TagTracker:
    """Locates a camera by tags of known places, and bodies by their tags.

    Args:
        layout: of the tags.
        lens: of the camera.
        camera: its name in the layout. is_alone: whether it is the only one.

    Attributes:
        camera: its name.
        numbers: of all tags in the layout.
        tags: those in the newest picture.
        found_place: the camera's place, once tags of the world have determined it.
        residual: deviation of the tags of the worst-fitting body from their places in the newest
            picture, pixels rms; NaN without a body.

    Raises MeasurementError for an unknown family, and for a camera without a place.
    """

    def __init__(
        self, layout: TagLayout, lens: Intrinsics, camera: str = "", *, is_alone: bool = True
    ) -> None:
        self._layout, self._lens, self.camera = layout, lens, camera
        self._detector = TagDetector(lens, layout.family)
        self.numbers = frozenset(layout.world).union(*layout.bodies.values())
        self.tags: Tags = {}
        self.found_place: CameraPlace | None = None
        self.residual = math.nan
        self._seen: list[Tags] = []  # tags of the world while the camera is being located
        self._stood: Tags = {}  # their pixels at that time
        self._place: tuple[Array, Array] | None = None  # position_w and R_wc
        if (measured := layout.place_of(camera, is_alone=is_alone)) is not None:
            self._place = np.array(measured.position), measured.axes_w
        self._attitude: dict[str, tuple[int, Array]] = {}
        self._count = 0

    def take(self, grey: Picture) -> dict[str, BodyPose]:
        """Return the pose of each body in a picture.

        Raises MeasurementError when the picture, the tags in it or the intrinsics are wrong.
        """
        self._count += 1
        self.tags, self.residual = {}, math.nan
        self.tags = tags = self._detector.tags(grey)
        position_w, R_wc = self._camera(tags)
        bodies = {}
        for name, places in self._layout.bodies.items():
            pose = self._pose(name, places, tags, R_wc)
            if pose is not None:
                self.residual = max(pose.residual, np.nan_to_num(self.residual))
                R_wb = R_wc @ pose.R_cb
                self._attitude[name] = self._count, R_wb
                place, to_world = position_w + R_wc @ pose.position_c, np.eye(6)
                to_world[:3, :3] = R_wc
                covariance = NOISE**2 * to_world @ np.linalg.inv(pose.information) @ to_world.T
                bodies[name] = BodyPose(place, quaternion_from_matrix(R_wb), covariance)
        return bodies

    def _pose(
        self, name: str, places: dict[int, TagPlace], tags: Tags, R_wc: Array
    ) -> TagPose | None:
        poses = fitting(f"the tags of {name}", places, tags, self._lens, RESIDUAL_MAX)
        if not poses:
            return None
        last, R_wb = self._attitude.get(name, (-REMEMBERED, np.eye(3)))
        if self._count - last < REMEMBERED:
            return likeliest(poses, R_wc.T @ R_wb)
        # A vehicle not seen before is probably upright.
        return likeliest(poses, max(poses, key=lambda pose: R_wc[2] @ pose.R_cb[:, 2]).R_cb)

    def _camera(self, tags: Tags) -> tuple[Array, Array]:
        """Return position_w and R_wc of the camera. Raises MeasurementError while they
        are unknown.
        """
        world = {number: tags[number] for number in self._layout.world if number in tags}
        if self._place is not None:
            off = [np.abs(world[n] - self._stood[n]).mean() for n in world if n in self._stood]
            if off and np.median(off) > MOVED:
                self._place = None
                raise MeasurementError(
                    f"the camera has moved, by {np.median(off):.1f} pixels; "
                    "its pose is being found again"
                )
            return self._place
        if not world:
            raise MeasurementError(
                "the camera's pose is not known: none of the tags with known places is seen ("
                f"{', '.join(map(str, sorted(self._layout.world)))}); turn it until one is"
            )
        self._seen.append(world)
        if len(self._seen) < PLACED_OVER:
            raise MeasurementError(f"the camera is being placed, {len(self._seen)}/{PLACED_OVER}")
        seen, self._seen = self._seen, []
        often = [n for n in self._layout.world if sum(n in one for one in seen) > PLACED_OVER / 2]
        mean = {n: np.mean([one[n] for one in seen if n in one], axis=0) for n in often}
        poses = fitting(
            "the tags with known places", self._layout.world, mean, self._lens, STILL_RESIDUAL_MAX
        )
        if not poses:
            raise MeasurementError("the tags with known places come and go; bring them closer")
        best = poses[0]
        if any(likeliest(poses, pose.R_cb) is not best for pose in poses[1:]):
            raise MeasurementError(
                "the camera may be in two places: the tags with known places look too small; add "
                "one that is larger, or far from them"
            )
        self._stood, R_wc = mean, best.R_cb.T
        self._place = -R_wc @ best.position_c, R_wc
        self.found_place = CameraPlace.of(*self._place)
        return self._place
