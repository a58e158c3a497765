"""Accepted intrinsics are kept where the tracker looks for them, and so are those before."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from extensions.vision.calibration import guided as guided_calibration
from extensions.vision.calibration.guided import Looked
from extensions.vision.command import Camera
from extensions.vision.tags.board_guide import BoardGuide
from extensions.vision.tags.camera_calibration import CameraCalibration
from extensions.vision.tags.intrinsics import load_intrinsics
from extensions.vision.tests.board_hand import Hand, walk
from extensions.vision.tracker.camera_store import CameraStore
from quadrotor.errors import MeasurementError, StorageError, UnreachableError, UsageError


@pytest.fixture(scope="module")
def found() -> CameraCalibration:
    return walk().result()


def test_what_is_accepted_is_in_use_and_what_was_before_is_kept(
    tmp_path: Path, found: CameraCalibration
) -> None:
    store = CameraStore(tmp_path)
    assert store.history(0) == []
    first = replace(found, matrix=(500.0, *found.matrix[1:]))
    store.keep(0, first, "anna", now=0.0)
    path = store.keep(0, found, "otto", now=60.0)
    assert path == tmp_path / "cameras" / "camera0.yaml"
    np.testing.assert_allclose(load_intrinsics(path).matrix, found.intrinsics.matrix)
    now, earlier = store.history(0)
    assert (now["requester"], now["date"]) == ("otto", "1970-01-01T00:01:00Z")
    assert now["residual"] == pytest.approx(found.residual, abs=1e-3)
    assert (earlier["requester"], earlier["focal_lengths"][0]) == ("anna", 500.0)
    assert store.history(1) == []


def test_a_file_that_cannot_be_read_or_written_is_told(
    tmp_path: Path, found: CameraCalibration
) -> None:
    store = CameraStore(tmp_path)
    path = store.keep(2, found, "anna")
    path.write_text("image_width: many\n")
    assert str(path) in store.history(2)[0]["problem"]
    (tmp_path / "blocked").write_text("")
    with pytest.raises(StorageError, match="nothing was changed"):
        CameraStore(tmp_path / "blocked").keep(0, found, "anna")


def test_cameras_are_listed_without_their_other_nodes(tmp_path: Path) -> None:
    for node, index in (("video2", "0"), ("video0", "0"), ("video1", "1")):
        (tmp_path / node).mkdir()
        (tmp_path / node / "index").write_text(f"{index}\n")
        (tmp_path / node / "name").write_text(f"Camera at {node}\n")
    store = CameraStore(tmp_path, devices=tmp_path)
    assert store.devices() == {0: "Camera at video0", 2: "Camera at video2"}
    assert CameraStore(tmp_path, devices=tmp_path / "none").devices() == {}


@pytest.fixture
def walking(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a hand follow the guide, in place of a camera's pictures."""

    def guided(camera: Any, board: Any, guide: BoardGuide, pace: float = 0.0) -> Iterator[Looked]:
        hand = Hand(guide, np.random.default_rng(3))
        while guide.goal is not None:
            was_taken = hand.hold(guide.goal.key)
            yield Looked(0, np.zeros((480, 640), np.uint8), was_taken)

    monkeypatch.setattr(guided_calibration, "guided", guided)


@pytest.mark.usefixtures("walking")
def test_the_command_guides_and_stores_the_result_as_the_page_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = Camera(data=tmp_path, square=0.05, marker=0.037)
    assert command.run() == 0
    [stored] = CameraStore(tmp_path).history(0)
    assert stored["focal_lengths"][0] == pytest.approx(600.0, abs=3.0)
    said = capsys.readouterr().out.splitlines()
    assert "  Tilt the board: its left edge towards the camera" in said
    assert str(CameraStore(tmp_path).path(0)) in said[-1]


@pytest.mark.usefixtures("walking")
def test_the_command_writes_a_chosen_file_and_no_file_twice(tmp_path: Path) -> None:
    out = tmp_path / "camera.yaml"
    command = Camera(out, square=0.05, marker=0.037)
    assert command.run() == 0
    assert load_intrinsics(out).matrix[0, 0] == pytest.approx(600.0, abs=3.0)
    with pytest.raises(UsageError, match="exists already"):
        command.run()


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (Camera(board="7by5"), "7by5"),
        (Camera(board="2x5"), "2 x 5 squares"),
        (Camera(video=Path("a.avi")), "--out FILE"),
        (Camera(paper=Path("/")), "exists already"),
        (Camera(paper=Path("/nowhere/board.pdf")), "name a file that can be written"),
    ],
)
def test_the_command_refuses_what_makes_no_calibration(wrong: Camera, told: str) -> None:
    with pytest.raises((UsageError, MeasurementError, StorageError), match=told):
        wrong.run()


def test_the_command_writes_the_board_to_be_printed(tmp_path: Path) -> None:
    assert Camera(paper=tmp_path / "board.pdf").run() == 0
    assert (tmp_path / "board.pdf").read_bytes().startswith(b"%PDF")


def test_a_video_that_ends_too_early_is_told(tmp_path: Path) -> None:
    video = tmp_path / "dark.avi"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (64, 48))
    writer.write(np.zeros((48, 64, 3), np.uint8))
    writer.release()
    with pytest.raises(MeasurementError, match="in 0 pictures, 8 are needed"):
        Camera(tmp_path / "camera.yaml", video=video).run()
    assert not (tmp_path / "camera.yaml").exists()


def test_a_camera_that_is_unplugged_ends_the_calibration_with_the_reason(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    class Unplugged:
        def __init__(self, camera: int) -> None:
            self.is_closed = False

        def __iter__(self) -> Iterator[tuple[None, int, Any]]:
            yield None, 0, np.full((48, 64), 128, np.uint8)
            raise UnreachableError("camera 0 delivers no more pictures: plug it in again")

        def close(self) -> None:
            self.is_closed = True

    monkeypatch.setattr("extensions.vision.tracker.camera.Pictures", Unplugged)
    with pytest.raises(UnreachableError, match="plug it in again"):
        Camera(data=tmp_path).run()
    assert CameraStore(tmp_path).history(0) == []
