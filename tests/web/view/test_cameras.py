"""A page's camera goes where it was chosen to, and moves with the vehicle from there."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from web.view.cameras import OFFSETS, Camera, Cameras
from web.view.shapes import IDENTITY, Quaternion

QUARTER: Quaternion = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # its nose along y


@pytest.fixture
def camera() -> Any:
    return SimpleNamespace(position=np.array([-2.0, 0.0, 2.0]), look_at=np.array([0.0, 0.0, 1.0]))


@pytest.fixture
def cameras(camera: Any) -> Cameras:
    server = SimpleNamespace(
        clients_of=lambda views: dict.fromkeys(views, SimpleNamespace(camera=camera))
    )
    return Cameras(cast(Any, server))


@pytest.mark.parametrize("chosen", ["top", "side"])
def test_from_above_and_the_side_it_can_be_zoomed_while_it_follows(
    cameras: Cameras, camera: Any, chosen: Camera
) -> None:
    cameras.choose("mine", chosen)
    cameras.move((1.0, 0.5, 1.5), IDENTITY)
    np.testing.assert_allclose(camera.look_at, (1.0, 0.5, 1.5))
    np.testing.assert_allclose(camera.position - camera.look_at, OFFSETS[chosen])
    camera.position = camera.look_at + 0.5 * np.array(OFFSETS[chosen])
    cameras.move((2.0, 0.5, 1.5), IDENTITY)
    np.testing.assert_allclose(camera.position - camera.look_at, 0.5 * np.array(OFFSETS[chosen]))


def test_the_first_person_sits_behind_the_nose_and_looks_along_it(
    cameras: Cameras, camera: Any
) -> None:
    cameras.choose("mine", "first")
    cameras.move((1.0, 0.0, 1.0), QUARTER)
    np.testing.assert_allclose(camera.position, (1.0, 0.16, 1.06), atol=1e-9)
    np.testing.assert_allclose(camera.look_at, (1.0, 2.0, 1.06), atol=1e-9)


def test_a_free_camera_stays(cameras: Cameras, camera: Any) -> None:
    cameras.choose("mine", "follow")
    cameras.choose("mine", "free")
    cameras.move((1.0, 0.0, 1.0), IDENTITY)
    np.testing.assert_allclose(camera.position, (-2.0, 0.0, 2.0))


def test_a_page_drawn_by_the_processor_alone_has_no_shadows_and_a_ground_of_lines() -> None:
    scene = _Drawn()
    client = SimpleNamespace(scene=scene)
    server = SimpleNamespace(clients_of=lambda views: dict.fromkeys(views, client))
    cameras = Cameras(cast(Any, server))
    cameras.shows_ground = False
    cameras.simplify("mine", plain=True)
    for _ in range(2):
        cameras.tell_new()
    assert scene.drawn == ["no shadows", "lines"], "once for a client"
    assert not scene.ground.visible
    cameras.simplify("mine", plain=False)
    cameras.tell_new()
    assert scene.drawn[2:] == ["shadows", "grid"]


class _Drawn:
    """Scene of one client, which stores what was asked of it."""

    def __init__(self) -> None:
        self.drawn: list[str] = []
        self.ground = SimpleNamespace(visible=True)

    def configure_default_lights(self, cast_shadow: bool) -> None:
        self.drawn.append("shadows" if cast_shadow else "no shadows")

    def add_grid(self, name: str, **_: Any) -> Any:
        self.drawn.append("grid")
        return self.ground

    def add_line_segments(self, name: str, *_: Any, **__: Any) -> Any:
        self.drawn.append("lines")
        return self.ground
