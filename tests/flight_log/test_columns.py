"""Columns have the content of the log's messages, are read once, and are made again if needed."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import xxhash

from benchmarks.logs.recorded_run import MadeRun, write_run
from flight_log import read_log
from flight_log.columns import log_columns, places
from flight_log.columns.log_columns import kept_columns, read_columns
from flight_log.columns.places import CACHES, place_of
from flight_log.columns.writer import INDEX
from flight_log.file import LogFile
from quadrotor.errors import StorageError
from vehicle_link.messages import decode

STATE, HEIGHT = "/quad1/state", "pose.pose.position.z"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Return a run of a data folder, which has a folder for columns."""
    (tmp_path / "runs" / CACHES).mkdir(parents=True)
    return write_run(tmp_path / "runs" / "a.mcap", MadeRun(4.0, marks=[(2.0, "gust")]))


def heights(log: Path) -> npt.NDArray[np.floating[Any]]:
    return read_columns(log, dtype=np.float64).topics[STATE].values(HEIGHT).copy()


def decoded(log: Path) -> list[float]:
    found = read_log(log, topics=[STATE])
    return [decode(one.payload, "nav_msgs/Odometry").pose.pose.position.z for one in found]


def test_columns_that_an_older_reader_could_not_fill_are_made_again(log: Path) -> None:
    read_columns(log, dtype=np.float64)
    file = place_of(log) / INDEX
    whole = json.loads(file.read_bytes().partition(b"\n")[2])

    def said(**older: Any) -> bytes:
        data = json.dumps({**whole, **older}).encode()
        file.write_bytes(f"{xxhash.xxh3_64_hexdigest(data)}\n".encode() + data)
        read_columns(log, dtype=np.float64)
        return file.read_bytes().partition(b"\n")[2]

    unread = {"problems": {"/service": "cannot be read"}}
    assert json.loads(said(**unread, reader="of last year"))["problems"] == {}
    assert json.loads(said(**unread))["problems"] == unread["problems"]  # would not be read now
    assert json.loads(said(reader="of last year"))["reader"] == "of last year"  # nothing is lacking


@pytest.mark.parametrize("held", [100, 1 << 15])
def test_numbers_stamps_and_payloads_are_the_messages_own(
    log: Path, monkeypatch: pytest.MonkeyPatch, held: int
) -> None:
    monkeypatch.setattr("flight_log.columns.writer.HELD", held)
    found = read_columns(log, dtype=np.float64).topics
    state = found[STATE]
    messages = list(read_log(log, topics=[STATE]))
    assert state.values(HEIGHT).tolist() == decoded(log)
    assert state.log_ns.tolist() == [one.log_ns for one in messages]
    assert state.header_ns.tolist() == state.publish_ns.tolist()
    assert state.constants["pose.covariance[7]"] == 0.0
    assert found["/quad1/marks"].payloads == [
        one.payload for one in read_log(log, topics=["/quad1/marks"])
    ]


def test_a_log_is_read_once_until_it_changes(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = heights(log)
    monkeypatch.setattr(log_columns, "write_columns", None)  # nothing can be made any more
    assert heights(log).tolist() == first.tolist()
    monkeypatch.undo()
    log.unlink()
    write_run(log, MadeRun(5.0))
    assert heights(log).tolist() == decoded(log)


def test_columns_are_made_and_read_without_pandas(log: Path) -> None:
    """Arrow imports it for conversions of its own, where it is installed: a second or more."""
    words = (
        "import sys; from pathlib import Path; "
        "from flight_log.columns.log_columns import read_columns; "
        f"found = read_columns(Path({str(log)!r})).topics[{STATE!r}]; "
        f"print(len(found.values({HEIGHT!r})), len(found.log_ns), 'pandas' in sys.modules)"
    )
    ran = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    count = len(decoded(log))
    assert ran.stdout.split() == [str(count), str(count), "False"]


@pytest.mark.parametrize("harm", ["flipped", "cut", "gone", "index", "half"])
def test_damaged_columns_are_made_again(log: Path, harm: str) -> None:
    before, place = heights(log), place_of(log)
    arrow = place / "0.arrow"
    if harm == "flipped":
        data = bytearray(arrow.read_bytes())
        data[len(data) // 2] ^= 1
        arrow.write_bytes(data)
    elif harm == "cut":
        os.truncate(arrow, 1000)
    elif harm == "gone":
        arrow.unlink()
    elif harm == "index":
        (place / "log.json").write_bytes((place / "log.json").read_bytes().replace(b"4.0", b"4.1"))
    else:
        (place / "log.json").unlink()
    assert heights(log).tolist() == before.tolist()
    assert sorted(one.name for one in place.parent.iterdir()) == ["a"]


def test_without_a_place_a_log_is_read_all_the_same(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place_of(log).parent.rmdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(log))  # a file, so that no folder can be made in it
    found = read_columns(log, dtype=np.float64)
    assert found.topics[STATE].values(HEIGHT).tolist() == decoded(log)
    assert found.note.startswith("the columns of a.mcap are not kept (")
    assert "\n" not in found.note


def test_where_no_disk_has_room_that_is_said_and_nothing_is_left(log: Path) -> None:
    before, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))
    try:
        with pytest.raises(StorageError, match=r"no room for the columns of a\.mcap"):
            read_columns(log)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (before, hard))
    assert list(place_of(log).parent.iterdir()) == []
    assert heights(log).tolist() == decoded(log)


def test_columns_of_a_log_that_grows_are_made_again_when_it_has_grown(log: Path) -> None:
    data = log.read_bytes()
    growing = LogFile(log.with_name("b.mcap"))
    growing.write(data[: len(data) // 2])
    assert read_columns(growing.path).tear
    before = heights(growing.path)
    growing.write(data[len(data) // 2 : -5000])
    assert kept_columns(growing.path).topics[STATE].values(HEIGHT).tolist() == pytest.approx(before)
    assert len(heights(growing.path)) > len(before) > 100
    growing.close()


def test_old_columns_go_and_the_newest_stay(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    heights(log)
    other = write_run(log.with_name("other.mcap"), MadeRun(2.0))
    os.utime(place_of(log) / "log.json", (1, 1))
    monkeypatch.setattr(places, "LARGEST", 1000)
    heights(other)
    assert [one.name for one in place_of(log).parent.iterdir()] == ["other"]


def test_what_a_killed_process_has_left_goes_and_columns_of_removed_runs(log: Path) -> None:
    caches = place_of(log).parent
    ended = subprocess.Popen(["true"])
    ended.wait()
    for name in (f"a.{ended.pid}.new", f"b.{ended.pid}.new", "gone", f"b.{os.getpid()}.new"):
        (caches / name / "scratch").mkdir(parents=True)
    (caches / "a").mkdir()  # columns of a run that exists, but damaged
    heights(log)
    assert sorted(one.name for one in caches.iterdir()) == ["a", f"b.{os.getpid()}.new"]
