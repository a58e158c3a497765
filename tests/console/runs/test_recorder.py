"""The recorder never blocks its callers, and reports what it could not store."""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from console.runs import disk
from console.runs.recorder import Recorder
from console.runs.run import Run, RunEnd
from flight_log import is_closed, read_attachments, read_log, read_metadata
from quadrotor.errors import StorageError
from tests.waiting import LIMIT, until

STRING = "std_msgs/String"


def run_in(folder: Path, name: str = "run1", **fields: object) -> Run:
    return Run(name, folder / f"{name}.mcap", {"run_id": name}, **fields)  # type: ignore[arg-type]


@pytest.fixture
def ends() -> list[RunEnd]:
    return []


@pytest.fixture
def recorder(tmp_path: Path, ends: list[RunEnd]) -> Iterator[Recorder]:
    recorder = Recorder(tmp_path, on_end=ends.append)
    yield recorder
    recorder.close()


def put(recorder: Recorder, count: int, first: int = 0) -> None:
    for i in range(first, first + count):
        recorder.put("/a", STRING, b"\0\1\0\0", i, i)


def test_what_is_put_during_a_run_is_in_its_file(
    tmp_path: Path, recorder: Recorder, ends: list[RunEnd]
) -> None:
    put(recorder, 5)
    recorder.start(run_in(tmp_path, attachments=lambda: {"parameters.json": b"{}"}))
    put(recorder, 100, first=10)
    assert recorder.status().recording
    assert recorder.status().run_id == "run1"
    recorder.stop()
    put(recorder, 5, first=500)
    assert recorder.wait_idle(LIMIT)
    path = tmp_path / "run1.mcap"
    assert [m.log_ns for m in read_log(path)] == list(range(10, 110))
    assert read_attachments(path) == {"parameters.json": b"{}"}
    assert read_metadata(path)["quadlab.run"] == {"run_id": "run1"}
    [end] = ends
    assert (end.messages, end.dropped, end.problem) == (100, 0, "")
    assert end.bytes == path.stat().st_size
    assert not recorder.status().recording


def test_closing_the_recorder_closes_the_file(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path)
    recorder.start(run_in(tmp_path))
    put(recorder, 1000)
    recorder.close()
    assert is_closed(tmp_path / "run1.mcap")
    assert len(list(read_log(tmp_path / "run1.mcap"))) == 1000


def test_runs_follow_each_other_without_mixing(tmp_path: Path, recorder: Recorder) -> None:
    for name, first in (("run1", 0), ("run2", 100)):
        recorder.start(run_in(tmp_path, name))
        put(recorder, 10, first)
        recorder.stop()
    assert recorder.wait_idle(LIMIT)
    assert [m.log_ns for m in read_log(tmp_path / "run1.mcap")] == list(range(10))
    assert [m.log_ns for m in read_log(tmp_path / "run2.mcap")] == list(range(100, 110))


def test_a_second_start_is_refused_with_the_name_of_the_run(
    tmp_path: Path, recorder: Recorder
) -> None:
    recorder.start(run_in(tmp_path))
    with pytest.raises(StorageError, match="run1 is being recorded"):
        recorder.start(run_in(tmp_path, "run2"))


def test_a_slow_disk_costs_messages_that_are_counted_and_said_but_no_time(tmp_path: Path) -> None:
    gate = threading.Event()
    ends: list[RunEnd] = []

    def slow() -> dict[str, bytes]:
        assert gate.wait(LIMIT)
        return {}

    recorder = Recorder(tmp_path, on_end=ends.append, queue_limit=50)
    recorder.start(run_in(tmp_path, attachments=slow))
    put(recorder, 200)
    status = recorder.status()
    assert status.dropped >= 150
    assert any("dropped" in alarm for alarm in status.alarms)
    gate.set()
    recorder.close()
    kept = len(list(read_log(tmp_path / "run1.mcap")))
    assert kept + ends[0].dropped == 200


def test_too_little_space_refuses_the_start_and_is_an_alarm(
    tmp_path: Path, recorder: Recorder
) -> None:
    with pytest.raises(StorageError, match="MB are kept"):
        recorder.start(run_in(tmp_path, keep_free=10**18))
    assert any("MB are kept" in alarm for alarm in recorder.status().alarms)
    assert not recorder.status().recording
    recorder.start(run_in(tmp_path))
    assert recorder.status().alarms == ()


def test_a_disk_that_fills_up_ends_the_run_properly_with_an_alarm(
    tmp_path: Path, recorder: Recorder, ends: list[RunEnd], monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder.start(run_in(tmp_path, keep_free=1000))
    put(recorder, 10)
    monkeypatch.setattr("console.runs.recorder.free_bytes", lambda folder: 999)
    assert recorder.wait_idle(LIMIT)
    assert is_closed(tmp_path / "run1.mcap")
    assert any("MB are kept" in alarm for alarm in recorder.status().alarms)
    assert "MB are kept" in ends[0].problem
    put(recorder, 10)  # no caller sees an exception


def test_a_vanished_folder_ends_the_run_with_an_alarm(tmp_path: Path, ends: list[RunEnd]) -> None:
    folder = tmp_path / "runs"
    recorder = Recorder(folder, on_end=ends.append)
    recorder.start(run_in(folder))
    put(recorder, 10)
    assert until(lambda: (folder / "run1.mcap").exists())
    shutil.rmtree(folder)
    assert recorder.wait_idle(LIMIT)
    alarms = recorder.status().alarms
    assert any("vanished" in alarm for alarm in alarms), alarms
    assert "vanished" in ends[0].problem
    recorder.start(run_in(folder, "run2"))  # makes it again
    assert until(lambda: recorder.status().alarms == ())
    recorder.close()
    assert is_closed(folder / "run2.mcap")


def test_a_folder_that_cannot_be_made_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    recorder = Recorder(tmp_path / "file")
    with pytest.raises(StorageError, match="--data"):
        recorder.start(run_in(tmp_path / "file"))
    recorder.close()


def test_a_missing_folder_is_an_alarm_also_while_nothing_is_recorded(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "absent" / "runs")
    assert until(lambda: any("mounted?" in alarm for alarm in recorder.status().alarms))
    assert not (tmp_path / "absent").exists(), "its disk may be away"
    recorder.close()


def test_a_missing_folder_is_made_again_where_the_data_folder_is(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "runs")
    assert until((tmp_path / "runs").is_dir)
    recorder.close()
    assert recorder.status().alarms == ()


def test_a_catalogue_that_fails_is_an_alarm_and_the_file_is_whole(tmp_path: Path) -> None:
    def broken(run: object) -> None:
        raise StorageError("the catalogue is locked")

    recorder = Recorder(tmp_path, on_start=broken, on_end=broken)
    recorder.start(run_in(tmp_path))
    put(recorder, 3)
    recorder.stop()
    assert recorder.wait_idle(LIMIT)
    assert "the catalogue is locked" in recorder.status().alarms
    assert len(list(read_log(tmp_path / "run1.mcap"))) == 3
    recorder.close()


def test_an_unwritable_folder_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.access", lambda *_: False)
    with pytest.raises(StorageError, match="not writable; correct its permissions"):
        disk.check_folder(tmp_path, 0)


def test_missing_read_only_and_a_file_in_its_place_are_told_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    assert disk.folder_problem(tmp_path) == ("", "")
    assert disk.folder_problem(tmp_path / "a" / "runs") == (
        f"the folder {tmp_path}/a/runs is missing",
        "mount its disk, or choose another with --data",
    )
    found, advice = disk.folder_problem(tmp_path / "file")
    assert (found, advice.split(",")[0]) == (
        f"{tmp_path}/file is not a folder",
        "move that file away",
    )
    monkeypatch.setattr("os.statvfs", lambda _: SimpleNamespace(f_flag=os.ST_RDONLY))
    found, advice = disk.folder_problem(tmp_path)
    assert found == f"the disk of {tmp_path} is read-only"
    assert advice.startswith("mount it writable")


def test_sizes_below_a_gigabyte_are_in_megabytes() -> None:
    assert [disk.size_text(n) for n in (1e7, 9.99e8, 1e9, 1.25e10)] == [
        "10 MB",
        "999 MB",
        "1.0 GB",
        "12.5 GB",
    ]
