"""Bearings from a camera on board: correct in body axes, from the body's origin, or refused."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from extensions.vision.tags.beacon_markers import BeaconMarkers, Mount, load_beacon_markers
from extensions.vision.tags.intrinsics import Intrinsics
from extensions.vision.tags.tag_bearings import TagBearings
from extensions.vision.tests.tags.rendered import CAMERA, LENS, MATRIX, tag
from quadrotor.errors import MeasurementError
from quadrotor.records import Array
from quadrotor.rotations import rotation_exp

SIZE = 0.15
PLACES = {1: (-0.3, 0.2, 0.0), 2: (0.3, 0.2, 0.0), 3: (0.3, -0.2, 0.0), 7: (-0.3, -0.2, 0.1)}
"""Tags on the floor, m."""
TAGS = BeaconMarkers(
    size=SIZE, sigma=0.01, camera=Mount(position=(0.1, -0.05, -0.04), turn=(4.0, -3.0, 15.0))
)
PLACE, R_WB = np.array([0.1, 0.05, 1.9]), rotation_exp(np.array([0.05, 0.06, -0.2]))


def picture(
    at: Mapping[int, Sequence[tuple[float, ...]]], R_wb: Array = R_WB, place: Array = PLACE
) -> npt.NDArray[np.uint8]:
    """Return the camera's picture of tags at these places, by number."""
    to_camera, lens_b = TAGS.camera.axes_b.T, np.array(TAGS.camera.position)
    patterns = []
    for number, places in at.items():
        for one in places:
            from_body = R_wb.T @ (np.array(one) - place)
            patterns.append(tag(number, to_camera @ (from_body - lens_b), to_camera @ R_wb.T, SIZE))
    return CAMERA.take(patterns, np.random.default_rng(4))


ALL = {number: [place] for number, place in PLACES.items()}


def test_bearings_are_those_from_the_bodys_origin_whatever_the_cameras_place_and_turn() -> None:
    seen = TagBearings(TAGS, LENS).take(picture(ALL))
    assert seen.beacon_ids == [1, 2, 3, 7]
    to_beacons = (np.array(list(PLACES.values())) - PLACE) @ R_WB
    true = to_beacons / np.linalg.norm(to_beacons, axis=1)[:, None]
    off = np.linalg.norm(seen.bearings_b - true, axis=1)
    # Without the offset of the lens they would be off by 60 mrad.
    assert off.max() < 1e-3
    assert math.radians(0.01) < seen.sigma < 1e-3
    assert np.sqrt(np.mean(off**2) / 2) < 2.0 * seen.sigma


def test_a_camera_looks_down_with_the_top_of_its_picture_forward_unless_it_is_turned() -> None:
    np.testing.assert_allclose(Mount().axes_b @ (0, 0, 1), (0, 0, -1), atol=1e-12)
    np.testing.assert_allclose(Mount().axes_b @ (0, -1, 0), (1, 0, 0), atol=1e-12)
    forward = Mount(turn=(0.0, -90.0, 0.0)).axes_b
    np.testing.assert_allclose(forward @ (0, 0, 1), (1, 0, 0), atol=1e-12)
    np.testing.assert_allclose(forward @ (0, -1, 0), (0, 0, 1), atol=1e-12)


def test_pictures_without_tags_give_none_and_black_or_white_ones_are_told() -> None:
    reader = TagBearings(TAGS, LENS)
    seen = reader.take(picture({}))
    assert (seen.beacon_ids, seen.bearings_b.shape) == ([], (0, 3))
    for grey, words in ((0, "black"), (255, "white")):
        with pytest.raises(MeasurementError, match=f"the picture is {words}"):
            reader.take(np.full((480, 640), grey, np.uint8))


def test_a_tag_seen_twice_is_told() -> None:
    whole = picture({1: [PLACES[1], PLACES[3]], 2: [PLACES[2]]})
    with pytest.raises(MeasurementError, match="tag 1 is seen twice"):
        TagBearings(TAGS, LENS).take(whole)


def test_beacons_leave_their_places_with_the_intrinsics_of_another_camera() -> None:
    # Seen from the side, because straight from above a wrong focal length is only a wrong height.
    tilted = rotation_exp(np.array([0.5, 0.3, 0.0]))
    grey = picture(ALL, tilted, 1.7 * tilted[:, 2])
    good = TagBearings(TAGS, LENS)
    assert good.misfit(good.take(grey), PLACES) < 0.5
    off = [_of_another(scale).misfit(_of_another(scale).take(grey), PLACES) for scale in (0.9, 0.8)]
    assert 1.0 < off[0] < off[1]
    with pytest.raises(
        MeasurementError, match=r"corners of tag \d do not fit .* calibrate the camera"
    ):
        _of_another(0.5).take(grey)  # each tag alone shows it
    assert math.isnan(good.misfit(good.take(grey), {1: PLACES[1]}))  # too few to judge


def _of_another(scale: float) -> TagBearings:
    """Return a reader with focal lengths scaled from those of the camera."""
    matrix = MATRIX @ np.diag([scale, scale, 1.0])
    return TagBearings(TAGS, replace(LENS, matrix=matrix, distortion=np.zeros(5)))


def test_corners_that_fit_no_square_are_told_with_what_is_left() -> None:
    bent = np.array([[300.0, 200.0], [340.0, 200.0], [352.0, 240.0], [300.0, 228.0]])
    lens = Intrinsics(640, 480, MATRIX, np.zeros(5))
    with pytest.raises(MeasurementError, match=r"corners of tag 3 do not fit .* pixels are left"):
        TagBearings(TAGS, lens).seen({3: bent})


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "needs either size"),
        ("size = 0.2\n[camera]\nturn = [0, 0]", r"camera\.turn\.2"),
        ("size = -1", "size"),
        ("size = 0.2\nsise = 3", "sise"),
        ("[bodies.quad1.3]\nsize = 1", "bodies"),
    ],
)
def test_files_that_do_not_say_it_are_told(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "beacons.toml").write_text(text)
    with pytest.raises(MeasurementError, match=told):
        load_beacon_markers(tmp_path / "beacons.toml")
