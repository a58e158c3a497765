"""`quadlab tracker camera` reads videos and devices, and reports what is wrong with them."""

from __future__ import annotations

import threading
from pathlib import Path

import cv2
import numpy as np
import pytest

from console.trackers.camera_figures import figures_text
from console.trackers.source import Frame
from extensions.vision.tests.tags.rendered import CAMERA, LENS, a_scene
from extensions.vision.tracker import camera
from extensions.vision.tracker.camera import CameraSource, Pictures
from extensions.vision.tracker.camera_view import CameraView
from quadlab.commands.tracker import Tracker
from quadrotor.errors import MeasurementError, StorageError, UnreachableError, UsageError
from vehicle_link.topics.measurements import JPEG

TAGS = """
[bodies.cf7.3]
size = 0.12
position = [0, 0, 0.03]
[bodies.cf7.4]
size = 0.12
position = [-0.1, 0, -0.05]
turn = [90, 0, -90]
[camera]
position = [-3, 0.5, 2]
looks_at = [0, 0, 0.8]
"""
PLACES = [np.array([0.0, 0.1 * k, 0.9]) for k in range(4)]
RATE = 50.0


@pytest.fixture
def lens(tmp_path: Path) -> Path:
    LENS.save(tmp_path / "camera.yaml")
    return tmp_path / "camera.yaml"


@pytest.fixture
def tags(tmp_path: Path) -> Path:
    (tmp_path / "tags.toml").write_text(TAGS)
    return tmp_path / "tags.toml"


@pytest.fixture
def video(tmp_path: Path) -> Path:
    path = tmp_path / "flight.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), RATE, (640, 480))
    random = np.random.default_rng(5)
    for place in PLACES:
        grey = CAMERA.take(a_scene(place, np.eye(3)), random)
        writer.write(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def test_a_video_gives_frames_at_its_own_pace_with_its_own_stamps(
    video: Path, lens: Path, tags: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(camera, "LATEST_NS", 1 << 60)  # none is skipped on a busy computer
    frames: list[Frame] = []
    with pytest.raises(UsageError, match="has ended"):  # noqa: PT012  the end of the loop
        for frame in CameraSource.open(video, lens, tags).frames():
            frames.append(frame)
    stamps = [frame.stamp_ns or 0 for frame in frames]
    np.testing.assert_allclose(np.diff(stamps), 1e9 / RATE, atol=1e6)
    assert frames[-1].received_ns - frames[0].received_ns >= 0.99 * (stamps[-1] - stamps[0])
    for frame, place in zip(frames, PLACES, strict=True):
        (body,) = frame.bodies
        assert body.name == "cf7"
        np.testing.assert_allclose(body.position_w, place, atol=0.02)


def test_who_reads_a_video_slower_than_it_plays_gets_the_newest_picture(tmp_path: Path) -> None:
    path = tmp_path / "fast.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 50.0, (64, 48))
    for _ in range(100):  # 2 s
        writer.write(np.zeros((48, 64, 3), np.uint8))
    writer.release()
    read: list[tuple[int, int]] = []
    with pytest.raises(UsageError, match="has ended"):  # noqa: PT012  the end of the loop
        for stamp_ns, received_ns, _ in Pictures(path):
            read.append((stamp_ns or 0, received_ns))
            threading.Event().wait(0.1)  # a slow detector
    (first_ns, began_ns), *_ = read
    lags = [(received - began_ns) - (stamp - first_ns) for stamp, received in read]
    # All hundred would have taken 10 s, the last one 8 s late.
    assert 2 < len(read) < 40
    assert max(lags) < 1e9


class Unplugged:
    """Device that delivers one picture and is then unplugged."""

    def __init__(self, number: int) -> None:
        self.left, self.is_there = 1, number == 0

    def isOpened(self) -> bool:
        return self.is_there

    def set(self, *_: float) -> None: ...

    def get(self, _: int) -> float:
        return 0.0

    def release(self) -> None: ...

    def grab(self) -> bool:
        self.left -= 1
        return self.left >= 0

    def retrieve(self) -> tuple[bool, object]:
        return True, np.zeros((480, 640, 3), np.uint8)


def test_a_camera_that_is_unplugged_or_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cv2, "VideoCapture", Unplugged)
    with pytest.raises(UnreachableError, match="camera 1 cannot be opened"):
        Pictures(1)
    pictures = iter(Pictures(0))
    stamp_ns, _, _ = next(pictures)
    assert stamp_ns is None  # the driver gave none
    with pytest.raises(UnreachableError, match="camera 0 delivers no more pictures"):
        next(pictures)


def test_a_picture_that_is_refused_is_shown_all_the_same(
    lens: Path, tags: Path, tmp_path: Path
) -> None:
    path = tmp_path / "dark.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), RATE, (640, 480))
    for _ in range(3):
        writer.write(np.zeros((480, 640, 3), np.uint8))
    writer.release()
    view = CameraView()
    view.is_watched = True
    with pytest.raises(MeasurementError, match="the picture is black"):
        next(CameraSource.open(path, lens, tags, view).frames())
    assert view.newest is not None
    assert view.newest.jpeg.startswith(JPEG)
    assert "(black), tags in 0% of them" in figures_text(view.figures())


def test_files_that_are_no_videos_and_sizes_that_do_not_fit_are_told(
    video: Path, lens: Path, tags: Path, tmp_path: Path
) -> None:
    with pytest.raises(StorageError, match="no video"):
        CameraSource.open(tmp_path / "other.avi", lens, tags)
    with pytest.raises(UnreachableError, match="OpenCV cannot read the video"):
        CameraSource.open(tags, lens, tags)
    lens.write_text(lens.read_text().replace("image_width: 640", "image_width: 800"))
    with pytest.raises(MeasurementError, match=r"640 x 480 pixels, but .* 800 x 480"):
        next(CameraSource.open(video, lens, tags).frames())


def test_without_its_files_the_command_is_refused() -> None:
    with pytest.raises(UsageError, match="camera needs --tags FILE"):
        Tracker("camera").run()
