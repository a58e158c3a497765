"""Pictures for people: the tags are marked where they are, and the picture is small."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from estimation.tags.detector import UNUSED, USED, WIDEST, TagDetector, marked_picture
from tests.estimation.tags.rendered import CAMERA, LENS, a_scene

GREY = CAMERA.take(a_scene(np.array([0.0, 0.1, 0.9]), np.eye(3)), np.random.default_rng(1))
TAGS = TagDetector(LENS).tags(GREY)


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


def test_known_tags_are_outlined_in_another_colour_than_unknown_ones() -> None:
    assert {4, 10} <= TAGS.keys()
    picture = shown(marked_picture(GREY, TAGS, {4}))
    assert colours_at(picture, TAGS[4]) == ["used"] * 4
    assert colours_at(picture, TAGS[10]) == ["un"] * 4
    plain = shown(marked_picture(GREY, {}, {4}))
    assert colours_at(plain, TAGS[4]) == ["none"] * 4


def test_a_large_picture_is_made_small_with_its_marks_in_place() -> None:
    large = np.asarray(cv2.resize(GREY, None, fx=3, fy=3), np.uint8)
    tags = {number: 3.0 * (corners + 0.5) - 0.5 for number, corners in TAGS.items()}
    picture = shown(marked_picture(large, tags, {4}))
    assert picture.shape == (480, WIDEST, 3)
    assert colours_at(picture, TAGS[4]) == ["used"] * 4
