"""A fixed camera gives poses in the world, and reports what is wrong."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from extensions.vision.tags.intrinsics import Intrinsics, load_intrinsics
from extensions.vision.tags.tag_layout import CameraPlace, TagLayout, load_tags
from extensions.vision.tags.tag_tracker import PLACED_OVER, TagTracker
from extensions.vision.tests.tags.rendered import (
    CAMERA,
    DISTORTION,
    LAYOUT,
    LENS,
    MATRIX,
    STAND,
    a_scene,
)
from quadrotor.errors import MeasurementError, StorageError
from quadrotor.rotations import quaternion_to_matrix, rotation_exp, rotation_log

PLACE = np.array([0.0, 0.1, 0.9])
R_WB = rotation_exp(np.array([0.1, -0.15, 0.4]))
NOISE = np.random.default_rng(1)
PICTURE = CAMERA.take(a_scene(PLACE, R_WB), NOISE)
KNOWN = LAYOUT.model_copy(update={"world": {}, "camera": STAND})


def placed() -> TagTracker:
    tracker = TagTracker(LAYOUT, LENS)
    for _ in range(PLACED_OVER - 1):
        with pytest.raises(MeasurementError, match="being placed"):
            tracker.take(PICTURE)
    return tracker


@pytest.mark.parametrize("by", ["tags", "measure"])
def test_a_body_is_found_in_the_world(by: str) -> None:
    tracker = placed() if by == "tags" else TagTracker(KNOWN, LENS)
    position_w, quaternion_wb, _ = tracker.take(PICTURE)["cf7"]
    np.testing.assert_allclose(position_w, PLACE, atol=0.01)
    turn = rotation_log(R_WB.T @ quaternion_to_matrix(quaternion_wb))
    assert np.linalg.norm(turn) < np.radians(0.5)


def test_the_place_that_the_tags_give_can_be_written_into_the_file_of_tags() -> None:
    leaning = CameraPlace(position=(-3.0, 0.5, 2.0), looks_at=(0.0, 0.0, 0.8), roll=4.0)
    picture = CAMERA.take(a_scene(PLACE, R_WB, stand=leaning), NOISE)
    tracker = TagTracker(LAYOUT, LENS)
    for _ in range(PLACED_OVER - 1):
        with pytest.raises(MeasurementError, match="being placed"):
            tracker.take(picture)
    tracker.take(picture)
    assert tracker.found_place is not None
    read = CameraPlace(**tomllib.loads(f"cameras.0 = {tracker.found_place.text}")["cameras"]["0"])
    np.testing.assert_allclose(read.position, leaning.position, atol=0.01)
    np.testing.assert_allclose(read.axes_w, leaning.axes_w, atol=0.005)
    measured = TagTracker(LAYOUT.model_copy(update={"cameras": {"0": read}}), LENS, "0")
    np.testing.assert_allclose(measured.take(picture)["cf7"].position_w, PLACE, atol=0.01)


def test_a_camera_that_is_moved_is_told_and_placed_anew() -> None:
    tracker = placed()
    tracker.take(PICTURE)
    moved = CameraPlace(position=(-3.0, 0.3, 2.0), looks_at=(0.0, -0.2, 0.8))
    picture = CAMERA.take(a_scene(PLACE, R_WB, stand=moved), NOISE)
    with pytest.raises(MeasurementError, match="has moved"):
        tracker.take(picture)
    for _ in range(PLACED_OVER - 1):
        with pytest.raises(MeasurementError, match="being placed"):
            tracker.take(picture)
    np.testing.assert_allclose(tracker.take(picture)["cf7"][0], PLACE, atol=0.01)


@pytest.mark.parametrize("light", [0.02, 60.0])
def test_wrong_exposure_is_told(light: float) -> None:
    picture = replace(CAMERA, light=light).take(a_scene(PLACE, R_WB), NOISE)
    with pytest.raises(MeasurementError, match="black" if light < 1 else "white"):
        TagTracker(KNOWN, LENS).take(picture)


def test_a_tag_that_is_seen_twice_is_told() -> None:
    twice = [*a_scene(PLACE, R_WB), a_scene(PLACE + np.array([0.0, 0.6, 0.0]), R_WB)[3]]
    with pytest.raises(MeasurementError, match="tag 3 is seen twice"):
        TagTracker(KNOWN, LENS).take(CAMERA.take(twice, NOISE))


@pytest.mark.parametrize(
    ("longer", "distortion"), [(1.3, DISTORTION), (1.0, np.zeros(5))], ids=["length", "distortion"]
)
def test_wrong_intrinsics_leave_a_residual_that_is_told(
    longer: float, distortion: npt.NDArray[np.float64]
) -> None:
    matrix = MATRIX * np.array([[longer], [longer], [1.0]])
    tracker = TagTracker(LAYOUT, Intrinsics(640, 480, matrix, distortion))
    told = ""
    for _ in range(PLACED_OVER):
        with pytest.raises(MeasurementError) as refused:
            tracker.take(PICTURE)
        told = str(refused.value)
    assert "pixels are left, allowed 0.5; calibrate the camera in Settings" in told


def test_without_the_tags_of_the_world_the_camera_has_no_place() -> None:
    body_alone = a_scene(PLACE, R_WB)[3:]
    with pytest.raises(MeasurementError, match="10, 11, 12"):
        TagTracker(LAYOUT, LENS).take(CAMERA.take(body_alone, NOISE))


def test_intrinsics_are_kept_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    LENS.save(path)
    read = load_intrinsics(path)
    assert (read.width, read.height) == (640, 480)
    np.testing.assert_array_equal(read.matrix, MATRIX)
    np.testing.assert_array_equal(read.distortion, DISTORTION)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("plumb_bob", "equidistant", "equidistant"),
        ("image_width", "width", "image_width"),
        ("600.0", "-600.0", "focal"),
        ("322.0", "1322.0", "principal"),
        ("rows: 3", "rows: [", "YAML"),
    ],
)
def test_a_bad_file_of_intrinsics_is_refused(tmp_path: Path, old: str, new: str, told: str) -> None:
    path = tmp_path / "camera.yaml"
    LENS.save(path)
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(MeasurementError, match=told):
        load_intrinsics(path)
    with pytest.raises(StorageError):
        load_intrinsics(tmp_path / "other.yaml")


TAGS = """
[bodies.quad1.3]
size = 0.12
position = [0, 0, 0.04]
turn = [0, 0, 90]
[world.10]
size = 0.3
position = [1, 0, 0]
"""


def test_tags_are_read_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "tags.toml"
    path.write_text(TAGS)
    layout = load_tags(path)
    top_left = layout.bodies["quad1"][3].corners[0]
    np.testing.assert_allclose(top_left, (-0.06, -0.06, 0.04), atol=1e-12)
    assert isinstance(layout, TagLayout)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("size = 0.12", "size = -0.12", "bodies.quad1.3.size"),
        ("size = 0.12\n", "", "bodies.quad1.3.size"),
        ("size = 0.12", "width = 0.12", "bodies.quad1.3"),
        ("world.10", "world.3", "tag 3 is in it twice"),
        ("[world.10]\nsize = 0.3\nposition = [1, 0, 0]", "", "places in the world"),
        ("[world.10]", "[world.10", "line"),
    ],
)
def test_a_bad_file_of_tags_is_refused(tmp_path: Path, old: str, new: str, told: str) -> None:
    path = tmp_path / "tags.toml"
    path.write_text(TAGS.replace(old, new))
    with pytest.raises(MeasurementError, match=told):
        load_tags(path)
