"""One guided calibration of a camera at a time, and nothing changes until it is accepted."""

from __future__ import annotations

import base64
import threading
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from extensions.vision.calibration import calibrations
from extensions.vision.calibration.calibrations import CameraCalibrations
from extensions.vision.calibration.routes import FEATURE, calibrations_of
from extensions.vision.tags.camera_calibration import CameraCalibration
from extensions.vision.tags.charuco import Board
from extensions.vision.tags.intrinsics import load_intrinsics
from extensions.vision.tests.board_hand import walk
from extensions.vision.tracker.camera_store import CameraStore
from quadrotor.errors import JobError, QuadlabError, RefusedError, StorageError, UnreachableError

JPEG = base64.b64encode(b"\xff\xd8picture").decode()


@cache
def found() -> CameraCalibration:
    return walk().result()


class ScriptedJob:
    """The process of a calibration, which ends when the test says so."""

    newest: ScriptedJob

    def __init__(self, function: Any, *arguments: Any, niceness: int, report: Any) -> None:
        type(self).newest = self
        self.arguments, self._report = arguments, report
        self._ended = threading.Event()
        self.outcome: CameraCalibration | Exception | None = None
        self.is_stopped = self.is_terminated = False

    def poll(self, timeout: float = 0.0) -> bool:
        return self._ended.wait(0.01)

    def terminate(self) -> None:
        self.is_terminated = True
        self.end(found())

    def stop(self) -> None:
        self.is_stopped = True

    def end(self, outcome: CameraCalibration | Exception) -> None:
        self.outcome = outcome
        self._ended.set()

    def report(self, views: int) -> None:
        self._report({"views": views, "picture": JPEG})

    def result(self) -> CameraCalibration:
        if isinstance(self.outcome, Exception):
            raise self.outcome
        assert self.outcome is not None
        return self.outcome


@pytest.fixture
def cameras(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[CameraCalibrations]:
    monkeypatch.setattr(calibrations, "Job", ScriptedJob)
    made = CameraCalibrations(CameraStore(tmp_path))
    yield made
    made.stop()


@pytest.fixture
def job(cameras: CameraCalibrations, until: Callable[..., None]) -> ScriptedJob:
    """Return the process of a calibration that anna has begun."""
    ScriptedJob.newest = None  # type: ignore[assignment]
    cameras.begin(0, Board(), "anna")
    until(lambda: ScriptedJob.newest is not None)
    return ScriptedJob.newest


def state(cameras: CameraCalibrations) -> str:
    return str(cameras.as_json()["state"])


def test_an_accepted_result_is_where_the_tracker_looks_for_it(
    cameras: CameraCalibrations, job: ScriptedJob, until: Callable[..., None]
) -> None:
    job.report(3)
    assert cameras.as_json()["progress"] == {"views": 3}
    job.end(found())
    until(lambda: state(cameras) == "ready")
    assert job.is_stopped
    assert cameras.store.history(0) == []
    assert cameras.as_json()["result"]["warnings"] == []
    cameras.accept("otto")
    assert cameras.as_json()["decision"] == "accepted"
    path = cameras.store.path(0)
    assert cameras.as_json()["file"] == str(path)
    assert load_intrinsics(path).matrix[0, 0] == pytest.approx(found().matrix[0])
    with pytest.raises(RefusedError, match="calibrate a camera first"):
        cameras.accept("anna")


@pytest.mark.parametrize(
    "why",
    [
        UnreachableError("camera 0 delivers no more pictures: plug it in again"),
        JobError("its process was killed by SIGKILL"),
        ValueError("a defect"),
    ],
)
def test_a_camera_that_is_unplugged_and_a_process_that_dies_are_told(
    cameras: CameraCalibrations, job: ScriptedJob, until: Callable[..., None], why: Exception
) -> None:
    job.report(9)
    job.end(why)
    until(lambda: state(cameras) == "failed")
    assert str(why) in cameras.as_json()["reason"]
    assert cameras.store.history(0) == []
    cameras.begin(0, Board(), "otto")  # another try


def test_a_second_person_is_told_who_calibrates(
    cameras: CameraCalibrations, job: ScriptedJob, until: Callable[..., None]
) -> None:
    with pytest.raises(RefusedError, match="anna is calibrating camera 0; wait"):
        cameras.begin("simulated", Board(), "otto")
    job.end(found())
    until(lambda: state(cameras) == "ready")
    with pytest.raises(RefusedError, match="result of anna for camera 0 must be"):
        cameras.begin("simulated", Board(), "otto")
    cameras.begin(1, Board(), "anna")  # her own she may drop


def test_too_few_views_are_not_finished_with(
    cameras: CameraCalibrations, job: ScriptedJob, until: Callable[..., None]
) -> None:
    job.report(7)
    with pytest.raises(RefusedError, match="in 7 pictures, 8 are needed"):
        cameras.finish()
    assert not job.is_terminated
    job.report(8)
    cameras.finish()
    until(lambda: state(cameras) == "ready")
    assert job.is_terminated


def test_cancel_changes_nothing(
    cameras: CameraCalibrations, job: ScriptedJob, until: Callable[..., None]
) -> None:
    cameras.cancel()
    until(lambda: job.is_stopped)
    until(lambda: state(cameras) == "none")
    for act in (cameras.cancel, cameras.finish):
        with pytest.raises(RefusedError, match="no camera is being calibrated"):
            act()
    cameras.begin(0, Board(), "anna")
    until(lambda: ScriptedJob.newest is not job)
    ScriptedJob.newest.end(found())
    until(lambda: state(cameras) == "ready")
    cameras.cancel()
    assert cameras.as_json()["decision"] == "rejected"
    assert cameras.store.history(0) == []
    with pytest.raises(RefusedError):
        cameras.accept("anna")


def test_a_result_that_cannot_be_stored_still_waits(
    cameras: CameraCalibrations, job: ScriptedJob, until: Callable[..., None], tmp_path: Path
) -> None:
    job.end(found())
    until(lambda: state(cameras) == "ready")
    (tmp_path / "cameras").write_text("")
    with pytest.raises(QuadlabError) as refused:
        cameras.accept("anna")
    assert isinstance(refused.value, StorageError)
    assert cameras.as_json()["decision"] == ""


def test_stopping_the_page_ends_the_calibration_of_every_data_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, until: Callable[..., None]
) -> None:
    monkeypatch.setattr(calibrations, "Job", ScriptedJob)
    ScriptedJob.newest = None  # type: ignore[assignment]
    shared = calibrations_of(tmp_path)
    assert calibrations_of(tmp_path) is shared
    shared.begin(0, Board(), "anna")
    until(lambda: ScriptedJob.newest is not None)
    FEATURE.stop()
    assert ScriptedJob.newest.is_stopped
    assert state(shared) == "none"
    assert calibrations_of(tmp_path) is not shared
