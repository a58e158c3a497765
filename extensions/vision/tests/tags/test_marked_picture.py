"""Pictures for people: the tags are marked where they are, and the picture is small."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from extensions.vision.tags.detector import UNUSED, USED, WIDEST, TagDetector, marked_picture
from extensions.vision.tests.tags.rendered import CAMERA, LENS, a_scene

Seen = tuple[npt.NDArray[np.uint8], dict[int, npt.NDArray[np.float64]]]


@pytest.fixture(scope="module")
def seen() -> Seen:
    """Return a picture, and the tags in it."""
    grey = CAMERA.take(a_scene(np.array([0.0, 0.1, 0.9]), np.eye(3)), np.random.default_rng(1))
    return grey, TagDetector(LENS).tags(grey)


def shown(jpeg: bytes) -> npt.NDArray[np.uint8]:
    return np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR), np.uint8)


def colours_at(picture: npt.NDArray[np.uint8], corners: npt.NDArray[np.float64]) -> list[str]:
    """Return the name of the colour at the middle of each edge of a tag."""
    found = []
    for middle in np.round(0.5 * (corners + np.roll(corners, 1, axis=0))).astype(int):
        here = picture[middle[1], middle[0]].astype(int)
        off = {
            name: int(np.abs(here - one).max()) for name, one in (("used", USED), ("un", UNUSED))
        }
        found.append(min(off, key=lambda name: off[name]) if min(off.values()) < 90 else "none")
    return found


def test_known_tags_are_outlined_in_another_colour_than_unknown_ones(seen: Seen) -> None:
    grey, tags = seen
    assert {4, 10} <= tags.keys()
    picture = shown(marked_picture(grey, tags, {4}))
    assert colours_at(picture, tags[4]) == ["used"] * 4
    assert colours_at(picture, tags[10]) == ["un"] * 4
    plain = shown(marked_picture(grey, {}, {4}))
    assert colours_at(plain, tags[4]) == ["none"] * 4


def test_a_large_picture_is_made_small_with_its_marks_in_place(seen: Seen) -> None:
    grey, found = seen
    large = np.asarray(cv2.resize(grey, None, fx=3, fy=3), np.uint8)
    tags = {number: 3.0 * (corners + 0.5) - 0.5 for number, corners in found.items()}
    picture = shown(marked_picture(large, tags, {4}))
    assert picture.shape == (480, WIDEST, 3)
    assert colours_at(picture, found[4]) == ["used"] * 4
