"""A vehicle with two tags, and cameras around the room that look at it: rendered as they see it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from extensions.vision.simulated.rendered_camera import Pattern, RenderedCamera
from extensions.vision.tags.detector import Picture, TagDetector
from extensions.vision.tags.intrinsics import Intrinsics
from extensions.vision.tags.tag_layout import CameraPlace, TagLayout, TagPlace
from quadrotor.records import Array
from quadrotor.rotations import quaternion_from_euler, quaternion_to_matrix

CAMERA = RenderedCamera(
    640,
    480,
    np.array([[600.0, 0.0, 322.0], [0.0, 602.0, 238.0], [0.0, 0.0, 1.0]]),
    np.array([-0.2, 0.05, 0.001, -0.001, 0.0]),
)
LENS = Intrinsics(CAMERA.width, CAMERA.height, CAMERA.matrix, CAMERA.distortion)
MIDDLE = (0.0, 0.0, 1.0)
STANDS = tuple(
    CameraPlace(position=place, looks_at=MIDDLE)
    for place in ((-3.2, 0.0, 2.6), (-0.9, -3.2, 2.8), (3.2, 0.6, 2.6), (0.9, 3.2, 2.8))
)
TAGS = {
    3: TagPlace(size=0.12, position=(0.0, 0.0, 0.03)),
    4: TagPlace(size=0.12, position=(-0.12, 0.0, -0.08), turn=(90.0, 0.0, -90.0)),
}
"""One on top and one at the back."""
STILL = np.zeros(3)


def layout(body: str, places: dict[str, CameraPlace]) -> TagLayout:
    """Return the tags of the vehicle, and the places of cameras by name, as its file tells them."""
    return TagLayout(bodies={body: TAGS}, cameras=places)


class Scene:
    """Renders what a camera at a place sees.

    Args:
        seed: of the pictures' noise. exposure: s; tags in motion smear.
    """

    def __init__(self, seed: int, exposure: float = 0.0) -> None:
        self._camera = replace(CAMERA, exposure=exposure)
        self._random = np.random.default_rng(seed)
        prints = TagDetector(LENS)
        self._pictures = {number: prints.picture(number) for number in TAGS}

    def picture(
        self,
        stand: CameraPlace,
        position_w: Array,
        R_wb: Array,
        velocity_w: Array = STILL,
        turning_b: Array = STILL,
    ) -> Picture:
        """Return the picture of a vehicle with this pose and motion: m/s, rad/s."""
        to_camera, patterns = stand.axes_w.T, []
        for number, one in TAGS.items():
            R_wt = R_wb @ quaternion_to_matrix(quaternion_from_euler(*np.radians(one.turn)))
            lever = R_wb @ np.array(one.position)
            turning_w, picture = R_wb @ turning_b, self._pictures[number]
            wide = one.size * len(picture) / (len(picture) - 2)
            patterns.append(
                Pattern(
                    picture,
                    (wide, wide),
                    to_camera @ (position_w + lever - np.array(stand.position)),
                    to_camera @ R_wt,
                    to_camera @ (velocity_w + np.cross(turning_w, lever)),
                    to_camera @ turning_w,
                )
            )
        return self._camera.take(patterns, self._random)
