"""Pictures of tags at known places, for the tests of their detection."""

from __future__ import annotations

import numpy as np

from extensions.vision.simulated.rendered_camera import Pattern, RenderedCamera
from extensions.vision.tags.detector import TagDetector
from extensions.vision.tags.intrinsics import Intrinsics
from extensions.vision.tags.tag_layout import CameraPlace, TagLayout, TagPlace
from quadrotor.records import Array
from quadrotor.rotations import quaternion_from_euler, quaternion_to_matrix, rotation_exp

SIZE = 0.12
MATRIX = np.array([[600.0, 0.0, 322.0], [0.0, 602.0, 238.0], [0.0, 0.0, 1.0]])
DISTORTION = np.array([-0.2, 0.05, 0.001, -0.001, 0.0])
LENS = Intrinsics(640, 480, MATRIX, DISTORTION)
CAMERA = RenderedCamera(640, 480, MATRIX, DISTORTION)
CORNERS = 0.5 * SIZE * np.array([[-1.0, 1.0, 0.0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
FACING = np.diag([1.0, -1.0, -1.0])
"""Rotation of a tag that faces the camera, upright."""


def a_pose(random: np.random.Generator, distance: float) -> tuple[Array, Array]:
    """Return position_c and R_ct of a randomly turned tag, tilted by 20 to 50 degrees."""
    around, tilt = random.uniform(-np.pi, np.pi, 2), random.uniform(0.35, 0.87)
    axis = np.array([np.cos(around[0]), np.sin(around[0]), 0.0])
    R_ct = FACING @ rotation_exp(np.array([0.0, 0.0, around[1]])) @ rotation_exp(tilt * axis)
    side = random.uniform(-1.0, 1.0, 2) * (0.35, 0.25)
    return distance * np.array([*side, 1.0]), R_ct


def tag(
    number: int, position_c: Array, R_ct: Array, size: float = SIZE, **motion: Array
) -> Pattern:
    """Return a printed tag with its rim; `size` is that of its black square, m."""
    picture = TagDetector(LENS).picture(number)
    wide = size * len(picture) / (len(picture) - 2)
    return Pattern(picture, (wide, wide), position_c, R_ct, **motion)


STAND = CameraPlace(position=(-3.0, 0.5, 2.0), looks_at=(0.0, 0.0, 0.8))
LAYOUT = TagLayout(
    bodies={
        "cf7": {
            3: TagPlace(size=0.12, position=(0.0, 0.0, 0.03)),
            4: TagPlace(size=0.12, position=(-0.1, 0.0, -0.05), turn=(90.0, 0.0, -90.0)),
        }
    },
    world={
        10: TagPlace(size=0.3, position=(0.3, 1.0, 0.0)),
        11: TagPlace(size=0.3, position=(0.3, -1.0, 0.0)),
        12: TagPlace(size=0.3, position=(1.0, 0.3, 1.0), turn=(90.0, 0.0, -90.0)),
    },
)
"""A body with a tag on top and one at its back, and tags on the floor and on a wall."""


def a_scene(
    position_w: Array, R_wb: Array, layout: TagLayout = LAYOUT, stand: CameraPlace = STAND
) -> list[Pattern]:
    """Return all tags as a camera at `stand` sees them; the body has a pose in the world."""
    to_camera = stand.axes_w.T
    patterns = []
    for places, place, R in (
        (layout.world, np.zeros(3), np.eye(3)),
        (layout.bodies["cf7"], position_w, R_wb),
    ):
        for number, one in places.items():
            turn = R @ quaternion_to_matrix(quaternion_from_euler(*np.radians(one.turn)))
            at = place + R @ np.array(one.position) - np.array(stand.position)
            patterns.append(tag(number, to_camera @ at, to_camera @ turn, one.size))
    return patterns
