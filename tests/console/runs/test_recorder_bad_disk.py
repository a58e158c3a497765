"""Whatever the disk does, the recorder blocks no caller, reports it, and the next run begins."""

from __future__ import annotations

import errno
import os
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from console.runs.recorder import Recorder
from console.runs.run import Run, RunEnd
from flight_log import is_closed, read_log, recover
from quadrotor.errors import StorageError
from tests.waiting import wait_for

STRING = "std_msgs/String"
LIMIT = 10.0


def run_in(folder: Path, name: str = "run1", **fields: object) -> Run:
    return Run(name, folder / f"{name}.mcap", {"run_id": name}, **fields)  # type: ignore[arg-type]


def put(recorder: Recorder, count: int, first: int = 0) -> None:
    for i in range(first, first + count):
        recorder.put("/a", STRING, b"\0\1\0\0", i * 1_000_000, i)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "runs"
    made.mkdir()
    return made


@pytest.fixture
def ends() -> list[RunEnd]:
    return []


@pytest.fixture
def recorder(folder: Path, ends: list[RunEnd]) -> Iterator[Recorder]:
    recorder = Recorder(folder, on_end=ends.append)
    yield recorder
    recorder.close()


def records_again(recorder: Recorder, folder: Path) -> bool:
    """Return whether the next run is complete, and the alarm of the one before is over."""
    recorder.start(run_in(folder, "next", keep_free=0))
    put(recorder, 5)
    recorder.stop()
    assert recorder.wait_idle(LIMIT)
    assert not any("recording stopped" in line for line in recorder.status().alarms)
    path = folder / "next.mcap"
    return is_closed(path) and len(list(read_log(path))) == 5


@pytest.mark.parametrize("room", [0, 100, 20_000])
def test_a_disk_without_room_ends_the_run_and_the_next_begins_when_there_is(
    folder: Path, recorder: Recorder, ends: list[RunEnd], room: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    left, real = [room], os.write

    def limited(descriptor: int, data: bytes) -> int:
        if left[0] <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        written = real(descriptor, data[: left[0]])
        left[0] -= written
        return written

    with monkeypatch.context() as full:
        full.setattr("os.write", limited)
        recorder.start(run_in(folder, keep_free=0))
        for first in range(0, 100_000, 1000):
            put(recorder, 1000, first)
            if recorder.wait_idle(0.001):
                break
        recorder.stop()
        assert recorder.wait_idle(LIMIT)
    assert any("No space left on device" in line for line in recorder.status().alarms)
    assert not recorder.status().recording
    path = folder / "run1.mcap"
    if room > 100:
        [end] = ends
        assert (end.closed, end.bytes) == (False, room)
        assert "No space left on device" in end.problem
        assert recover(path).messages > 0
    else:
        assert not path.exists() or path.stat().st_size == room, "it holds no message"
    assert records_again(recorder, folder)


@pytest.mark.parametrize("becomes", ["nothing", "a file", "another folder"])
def test_a_folder_that_becomes_something_else_ends_the_run_with_an_alarm(
    folder: Path, recorder: Recorder, ends: list[RunEnd], becomes: str
) -> None:
    recorder.start(run_in(folder, keep_free=0))
    put(recorder, 10)
    wait_for(lambda: recorder.status().bytes > 0)
    shutil.move(folder, folder.with_name("moved"))
    if becomes == "a file":
        folder.write_text("mine")
    elif becomes == "another folder":
        folder.mkdir()
    assert recorder.wait_idle(LIMIT)
    assert any("vanished" in line for line in recorder.status().alarms)
    assert (ends[0].closed, len(ends)) == (False, 1)
    kept = folder.with_name("moved") / "run1.mcap"
    assert len(list(read_log(kept))) == 10, "what was written stays whole"
    if becomes == "a file":
        with pytest.raises(StorageError, match="is not a folder; move that file away"):
            recorder.start(run_in(folder, "run2"))
        assert folder.read_text() == "mine"
        folder.unlink()
    assert records_again(recorder, folder)


def test_a_catalogue_that_takes_its_time_holds_up_no_message(folder: Path) -> None:
    gate = threading.Event()
    started: list[str] = []

    def slow(run: Run) -> None:
        assert gate.wait(LIMIT)
        started.append(run.run_id)

    ends: list[RunEnd] = []
    recorder = Recorder(folder, slow, ends.append)
    recorder.start(run_in(folder, keep_free=0))
    put(recorder, 100)
    recorder.stop()
    path = folder / "run1.mcap"
    wait_for(lambda: path.exists() and is_closed(path))
    assert len(list(read_log(path))) == 100
    assert (started, ends) == ([], [])
    gate.set()
    recorder.close()
    assert (started, len(ends)) == (["run1"], 1)


def test_a_disk_that_cannot_sync_ends_the_run(
    folder: Path, recorder: Recorder, ends: list[RunEnd], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(descriptor: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    with monkeypatch.context() as failing:
        failing.setattr("os.fdatasync", broken)
        recorder.start(run_in(folder, keep_free=0))
        put(recorder, 10)
        assert recorder.wait_idle(LIMIT)
    assert "Input/output error" in ends[0].problem
    assert records_again(recorder, folder)


@pytest.mark.parametrize("where", ["attachments", "catalogue", "message"])
def test_a_defect_costs_one_run_at_most_and_never_the_recorder(
    folder: Path, where: str, capfd: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError("a defect")

    run = run_in(folder, keep_free=0)
    if where == "attachments":
        run = run_in(folder, keep_free=0, attachments=broken)
    is_broken = [where == "catalogue"]

    def told(what: object) -> None:
        if is_broken[0]:
            broken()

    recorder = Recorder(folder, told, told)
    recorder.start(run)
    put(recorder, 3)
    if where == "message":
        recorder.put("/a", "no_msgs/Such", b"", 5, 5)
    recorder.stop()
    assert recorder.wait_idle(LIMIT)
    assert any("defect" in line for line in recorder.status().alarms)
    is_broken[0] = False
    assert records_again(recorder, folder)
    recorder.close()


def test_a_source_without_a_sound_clock_is_recorded(folder: Path, recorder: Recorder) -> None:
    """A publisher chooses its stamps; a log has none before the epoch."""
    recorder.start(run_in(folder, keep_free=0))
    recorder.put("/a", STRING, b"\0\1\0\0", 7, -5)
    recorder.stop()
    assert recorder.wait_idle(LIMIT)
    [message] = read_log(folder / "run1.mcap")
    assert (message.log_ns, message.publish_ns) == (7, 0)
