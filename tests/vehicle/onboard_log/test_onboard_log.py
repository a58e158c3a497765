"""Onboard log: which ticks are in the file, how it reports that it stops, what it repairs."""

from __future__ import annotations

import math
import os
import shutil
import threading
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from flight_log import is_closed, read_attachments, read_log, read_metadata
from quadrotor.errors import LinkError
from quadrotor.records import TICK, Record
from tests.support.narrowing import now
from tests.support.ticks import START_NS, level_ticks
from vehicle.onboard_log import file as onboard_sync
from vehicle.onboard_log import onboard_log
from vehicle.onboard_log.file import Batch
from vehicle.onboard_log.onboard_log import OnboardLog
from vehicle.onboard_log.parameters import OnboardLogParameters
from vehicle.onboard_log.repair import recover_logs, torn_logs
from vehicle_link.topics.control_inputs import encode_heartbeat
from vehicle_link.topics.ticks import decode_odometry

FREE_BYTES_MIN = OnboardLogParameters().stop_bytes
MS = 1_000_000
BOUND = 10.0
"""Time, in s, after which a waiting test fails."""


def ticks(first: int, count: int, *, armed: bool) -> Record:
    """Return ticks that rise by a millimetre each."""
    made = level_ticks(first, count, armed=armed)
    made["state"]["position_w"][:, 2] = 1e-3 * np.arange(first, first + count)
    return made


class Harness:
    def __init__(self, folder: Path, free: int = 2 * FREE_BYTES_MIN) -> None:
        self.said: list[tuple[int, str]] = []
        self.free = free
        self.folder = folder
        self.log = OnboardLog(
            folder,
            "quad1",
            {"parameters.json": lambda: b'{"model.mass": 1.3}'},
            lambda level, text: self.said.append((level, text)),
            free=lambda path: self.free,
        )
        self.log.start()

    def feed(self, *batches: Record) -> None:
        for batch in batches:
            self.log.ticks(batch, int(batch["imu"]["stamp_ns"][-1]) + MS)

    def files(self) -> list[Path]:
        return sorted((self.folder / "onboard").glob("*"))

    def stamps(self, path: Path, topic: str) -> list[int]:
        return [
            (message.publish_ns - START_NS) // (2 * MS)
            for message in read_log(path, [f"/quad1/{topic}"])
        ]


def test_every_tick_from_arming_to_half_a_second_after_disarming_is_there(tmp_path: Path) -> None:
    harness = Harness(tmp_path)
    mixed = np.concatenate([ticks(5, 3, armed=False), ticks(8, 4, armed=True)])
    flight = [ticks(12 + 5 * k, 5, armed=True) for k in range(40)]
    after = [ticks(212 + 5 * k, 5, armed=False) for k in range(80)]
    harness.feed(ticks(0, 5, armed=False), mixed, *flight, *after)
    harness.log.close()
    (path,) = harness.files()
    assert is_closed(path)
    for topic in ("state", "reference", "imu", "actuators"):
        assert harness.stamps(path, topic) == list(range(8, 212 + 250 + 1)), topic
    assert read_attachments(path) == {"parameters.json": b'{"model.mass": 1.3}'}
    assert read_metadata(path)["quadlab.run"]["vehicle"] == "quad1"


def test_calibrations_are_attached_as_they_are_when_the_file_begins(tmp_path: Path) -> None:
    in_force = [b"first", b"second"]
    log = OnboardLog(
        tmp_path,
        "quad1",
        {"calibrations.json": lambda: in_force.pop(0)},
        lambda *_: None,
        free=lambda _: 2 * FREE_BYTES_MIN,
    )
    for batch in (ticks(0, 5, armed=True), ticks(5, 300, armed=False), ticks(1000, 5, armed=True)):
        log.ticks(batch, int(batch["imu"]["stamp_ns"][-1]))
    log.close()
    found = [read_attachments(path) for path in sorted((tmp_path / "onboard").glob("*"))]
    assert [one["calibrations.json"] for one in found] == [b"first", b"second"]


def test_the_file_is_named_after_vehicle_and_utc(tmp_path: Path) -> None:
    harness = Harness(tmp_path)
    harness.feed(ticks(8, 5, armed=True))
    harness.log.close()
    assert [path.name for path in harness.files()] == ["quad1_20260528T202640_016Z.mcap"]


def test_states_are_those_of_the_ticks(tmp_path: Path) -> None:
    harness = Harness(tmp_path)
    harness.feed(ticks(0, 50, armed=True))
    harness.log.close()
    messages = list(read_log(harness.files()[0], ["/quad1/state"]))
    heights = [decode_odometry(m.payload)[1]["position_w"][0, 2] for m in messages]
    assert heights == [k * 1e-3 for k in range(50)]
    assert {m.type_name for m in messages} == {"nav_msgs/msg/Odometry"}
    assert all(m.log_ns == START_NS + 98 * MS + MS for m in messages)


def test_other_topics_are_kept_only_while_a_file_is_open(tmp_path: Path) -> None:
    harness = Harness(tmp_path)
    payload = encode_heartbeat(1, START_NS)

    def send(number: int) -> None:
        harness.log.message("station_heartbeat", "quadlab_msgs/Heartbeat", payload, number, number)

    send(1)
    harness.feed(ticks(0, 5, armed=True))
    send(2)
    harness.feed(ticks(5, 300, armed=False))
    send(3)
    harness.log.close()
    found = read_log(harness.files()[0], ["/quad1/station_heartbeat"])
    assert [message.publish_ns for message in found] == [2]


def test_each_flight_has_its_own_file(tmp_path: Path) -> None:
    harness = Harness(tmp_path)
    harness.feed(
        ticks(0, 10, armed=True),
        ticks(10, 300, armed=False),
        ticks(310, 10, armed=True),
        ticks(320, 300, armed=False),
    )
    harness.log.close()
    first, second = harness.files()
    assert harness.stamps(first, "imu") == list(range(261))
    assert harness.stamps(second, "imu") == list(range(310, 571))


def test_arming_again_within_half_a_second_stays_in_the_file(tmp_path: Path) -> None:
    harness = Harness(tmp_path)
    harness.feed(ticks(0, 10, armed=True), ticks(10, 50, armed=False), ticks(60, 10, armed=True))
    harness.log.close()
    (path,) = harness.files()
    assert harness.stamps(path, "imu") == list(range(70))


def test_a_full_disk_stops_the_log_with_one_event_and_a_whole_file(tmp_path: Path) -> None:
    harness = Harness(tmp_path, free=FREE_BYTES_MIN - 1)
    harness.feed(ticks(0, 10, armed=True), ticks(10, 10, armed=True))
    harness.log.close()
    assert harness.files() == []
    stopped = [text for _, text in harness.said]
    assert len(stopped) == 1
    assert "499 MB free" in stopped[0]
    assert "needs 500 MB" in stopped[0]


def test_the_next_arming_tries_again(tmp_path: Path) -> None:
    said: list[str] = []
    answers = iter([0, 2 * FREE_BYTES_MIN])
    log = OnboardLog(
        tmp_path, "quad1", {}, lambda _, text: said.append(text), free=lambda _: next(answers)
    )
    log.start()
    for first, armed in ((0, True), (10, False), (20, True)):
        batch = ticks(first, 10, armed=armed)
        log.ticks(batch, int(batch["imu"]["stamp_ns"][-1]))
    log.close()
    assert ["stopped" in text for text in said] == [True, False, False]
    assert len(list((tmp_path / "onboard").iterdir())) == 1


def test_a_disk_that_fills_in_flight_leaves_a_closed_file(tmp_path: Path) -> None:
    said: list[str] = []
    answers = iter([2 * FREE_BYTES_MIN, 0])
    log = OnboardLog(
        tmp_path, "quad1", {}, lambda _, text: said.append(text), free=lambda _: next(answers)
    )
    log.start()
    for second in range(3):
        batch = ticks(500 * second, 500, armed=True)
        log.ticks(batch, int(batch["imu"]["stamp_ns"][-1]))
    log.close()
    (path,) = (tmp_path / "onboard").iterdir()
    assert is_closed(path)
    assert sum("stopped: 0 MB free" in text for text in said) == 1
    assert len(list(read_log(path, ["/quad1/imu"]))) == 500


def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path) -> None:
    (tmp_path / "onboard").write_text("a file in the way")
    harness = Harness(tmp_path)
    harness.feed(ticks(0, 10, armed=True))
    harness.log.close()
    assert [level for level, _ in harness.said] == [40]
    assert "onboard log stopped: cannot use" in harness.said[0][1]


def test_what_came_before_the_start_is_written_with_the_parameters_of_the_start(
    tmp_path: Path,
) -> None:
    parameters = {"json": b"too early"}
    log = OnboardLog(
        tmp_path,
        "quad1",
        {"parameters.json": lambda: parameters["json"]},
        lambda *_: None,
        free=lambda _: 2 * FREE_BYTES_MIN,
    )
    log.ticks(ticks(0, 10, armed=True), START_NS)
    parameters["json"] = b"right"
    log.start()
    log.start()
    log.close()
    (path,) = (tmp_path / "onboard").iterdir()
    assert read_attachments(path) == {"parameters.json": b"right"}
    assert len(list(read_log(path, ["/quad1/imu"]))) == 10


def test_what_the_buffer_cannot_hold_is_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(onboard_log, "BUFFER_BYTES", 100 * TICK.itemsize)
    harness = Harness(tmp_path)
    harness.feed(ticks(0, 101, armed=True))  # more at once than it can hold
    harness.log.close()
    assert any("lost 101 ticks or messages" in text for _, text in harness.said)


def test_a_torn_log_is_found_and_mended(tmp_path: Path) -> None:
    harness = Harness(tmp_path)
    harness.feed(*[ticks(5 * k, 5, armed=True) for k in range(100)])
    harness.log.close()
    (path,) = harness.files()
    whole = Counter(m.topic for m in read_log(path))
    os.truncate(path, path.stat().st_size * 2 // 3)
    assert torn_logs(tmp_path) == [path]
    (line,) = recover_logs(torn_logs(tmp_path))
    assert "recovered" in line
    assert path.name in line
    assert torn_logs(tmp_path) == []
    kept = Counter(m.topic for m in read_log(path))
    assert 0 < kept["/quad1/imu"] < whole["/quad1/imu"]


def test_a_file_that_is_no_log_is_reported_and_left(tmp_path: Path) -> None:
    path = tmp_path / "onboard" / "quad1_x.mcap"
    path.parent.mkdir()
    path.write_bytes(b"not a log at all, but long enough")
    (line,) = recover_logs(torn_logs(tmp_path))
    assert "not recovered" in line
    assert path.read_bytes().startswith(b"not a log")


class Notification:
    """Events of the log, which a test can wait for."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._changed = threading.Condition()

    def __call__(self, level: int, text: str) -> None:
        with self._changed:
            self.lines.append(text)
            self._changed.notify_all()

    def wait_for(self, text: str) -> None:
        with self._changed:
            there = self._changed.wait_for(lambda: any(text in line for line in self.lines), BOUND)
        assert there, self.lines


def old_log(folder: Path, name: str) -> Path:
    """Write a closed log of 1 GB (sparse), an hour old."""
    path = folder / "onboard" / f"{name}.mcap"
    path.parent.mkdir(exist_ok=True)
    with path.open("wb") as stream:
        stream.seek(10**9 - 8)
        stream.write(b"\x89MCAP0\r\n")
    os.utime(path, (path.stat().st_mtime - 3600.0,) * 2)
    return path


def test_old_logs_are_removed_on_the_ground_and_not_in_flight(tmp_path: Path) -> None:
    first, told = old_log(tmp_path, "first"), Notification()
    limits = OnboardLogParameters(keep_size=0.5)
    log = OnboardLog(
        tmp_path, "quad1", {}, told, limits=lambda: limits, free=lambda _: 10 * FREE_BYTES_MIN
    )
    log.start()

    def feed(batch: Record) -> None:
        log.ticks(batch, int(batch["imu"]["stamp_ns"][-1]))

    feed(ticks(0, 10, armed=True))  # comms was restarted in flight
    told.wait_for("started")
    feed(ticks(10, 300, armed=False))
    told.wait_for("first.mcap (1.0 GB) removed: all are 1.0 GB, log.keep_size is 500.0 MB")
    assert ["started" in told.lines[0], "closed" in told.lines[1]] == [True, True]
    assert not first.exists()
    second = old_log(tmp_path, "second")
    feed(ticks(400, 10, armed=True))
    feed(ticks(410, 300, armed=False))
    told.wait_for("second.mcap")
    assert not second.exists()
    log.close()
    assert len(list((tmp_path / "onboard").iterdir())) == 2, "both flights"


def test_what_does_not_reach_the_disk_stops_the_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(descriptor: int) -> None:
        raise OSError(5, "Input/output error")

    path = tmp_path / "torn"
    path.write_bytes(b"x")
    with monkeypatch.context() as failing:
        failing.setattr(os, "fdatasync", fail)
        sync = onboard_sync.DiskSync(path, 0.001)
        sync._thread.join(BOUND)
    assert sync.problem == "torn does not reach the disk: Input/output error"
    told = Notification()
    log = OnboardLog(tmp_path, "quad1", {}, told, free=lambda _: 10 * FREE_BYTES_MIN)
    log._store([Batch(ticks(0, 10, armed=True), START_NS)])
    assert log._file is not None
    log._file._sync = sync
    later = [ticks(500 * second, 10, armed=True) for second in (1, 2)]
    for batch in later:
        log.ticks(batch, int(batch["imu"]["stamp_ns"][-1]))
    log.close()
    assert log.problem == sync.problem
    assert sum("stopped" in line for line in told.lines) == 1
    (logged,) = (tmp_path / "onboard").iterdir()
    assert is_closed(logged)


def test_a_flight_is_logged_even_without_its_parameters(tmp_path: Path) -> None:
    def unknown() -> bytes:
        raise LinkError("the flight process did not report its parameters")

    told = Notification()
    log = OnboardLog(
        tmp_path, "quad1", {"parameters.json": unknown}, told, free=lambda _: 10 * FREE_BYTES_MIN
    )
    log.ticks(ticks(0, 10, armed=True), START_NS)
    log.close()
    (path,) = (tmp_path / "onboard").iterdir()
    assert len(list(read_log(path, ["/quad1/imu"]))) == 10
    told.wait_for("onboard log without parameters.json: the flight process did not report")


def test_robot_and_firmware_are_in_the_file(tmp_path: Path) -> None:
    log = OnboardLog(
        tmp_path,
        "quad1",
        {},
        lambda *_: None,
        facts={"robot_id": "7", "firmware_revision": "3"},
        free=lambda _: 10 * FREE_BYTES_MIN,
    )
    log.ticks(ticks(0, 10, armed=True), START_NS)
    log.close()
    (path,) = (tmp_path / "onboard").iterdir()
    run = read_metadata(path)["quadlab.run"]
    assert (run["robot_id"], run["firmware_revision"]) == ("7", "3")


def test_what_is_written_goes_to_the_disk_each_period_until_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent = threading.Semaphore(0)
    path = tmp_path / "log"
    path.write_bytes(b"x")
    asked: list[str] = []

    def note(descriptor: int) -> None:
        asked.append(os.readlink(f"/proc/self/fd/{descriptor}"))
        sent.release()

    monkeypatch.setattr(os, "fdatasync", note)
    sync = onboard_sync.DiskSync(path, 0.001)
    for _ in range(3):
        assert sent.acquire(timeout=BOUND)
    sync.end()
    assert set(asked) == {str(path)}
    assert sync.problem == ""


def test_it_tells_of_each_tick_once_that_nothing_is_left_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(onboard_log, "BUFFER_BYTES", 100 * TICK.itemsize)
    done: list[tuple[int, int]] = []  # ticks, and bytes in the file at that report

    def written(count: int) -> None:
        done.append((count, sum(path.stat().st_size for path in tmp_path.glob("onboard/*"))))

    log = OnboardLog(
        tmp_path, "quad1", {}, lambda *_: None, free=lambda _: 10 * FREE_BYTES_MIN, written=written
    )
    for batch in (ticks(0, 10, armed=False), ticks(10, 50, armed=True), ticks(60, 101, armed=True)):
        log.ticks(batch, START_NS)
    log.close()
    assert sum(count for count, _ in done) == 161, "those that had no room, too"
    first = next(size for count, size in done if count)
    (path,) = tmp_path.glob("onboard/*")
    assert first > 5000, "they are in the file by then"
    assert len(list(read_log(path, ["/quad1/imu"]))) == 50


def test_a_process_killed_at_arming_does_not_keep_the_next_from_logging(tmp_path: Path) -> None:
    for _ in range(3):  # each begins with the same tick, which the one before had only read
        harness = Harness(tmp_path)
        harness.feed(ticks(8, 5, armed=True))
        harness.log.close()
    assert [path.name for path in harness.files()] == [
        "quad1_20260528T202640_016Z.mcap",
        "quad1_20260528T202640_016Z_2.mcap",
        "quad1_20260528T202640_016Z_3.mcap",
    ]
    assert [harness.stamps(path, "imu") for path in harness.files()] == [list(range(8, 13))] * 3


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r", b"\x89MCAP0\r\n"])
def test_a_file_of_a_writer_killed_before_its_first_record_is_removed(
    tmp_path: Path, content: bytes
) -> None:
    path = tmp_path / "onboard" / "quad1_x.mcap"
    path.parent.mkdir()
    path.write_bytes(content)
    (line,) = recover_logs(torn_logs(tmp_path))
    assert line.endswith("quad1_x.mcap removed: it holds nothing, its writer was killed")
    assert not path.exists()


def test_a_folder_removed_in_flight_is_told_within_a_second_and_a_new_file_begins(
    tmp_path: Path,
) -> None:
    told = Notification()
    log = OnboardLog(tmp_path, "quad1", {}, told, free=lambda _: 10 * FREE_BYTES_MIN)
    log.start()

    def feed(batch: Record) -> None:
        log.ticks(batch, int(batch["imu"]["stamp_ns"][-1]))

    feed(ticks(0, 10, armed=True))
    told.wait_for("quad1_20260528T202640_000Z.mcap started")
    shutil.rmtree(log.folder)
    feed(ticks(10, 480, armed=True))  # not checked yet: 0.98 s
    feed(ticks(490, 20, armed=True))
    told.wait_for("quad1_20260528T202640_980Z.mcap started")
    gone = f"{log.folder}/quad1_20260528T202640_000Z.mcap was removed, moved or replaced"
    assert told.lines[1] == f"onboard log stopped: {gone} while it was written"
    feed(ticks(510, 2000, armed=True))
    feed(ticks(2510, 300, armed=False))
    log.close()
    assert log.problem == f"{gone} while it was written", "of this flight not all is there"
    (path,) = log.folder.iterdir()
    stamps = [(m.publish_ns - START_NS) // (2 * MS) for m in read_log(path, ["/quad1/imu"])]
    assert stamps == list(range(490, 2761))
    assert sum("stopped" in line for line in told.lines) == 1


def test_a_log_moved_away_in_flight_keeps_its_index_where_it_is(tmp_path: Path) -> None:
    harness = Harness(tmp_path)
    harness.log.close()  # written here, by this thread
    harness.log._store([Batch(ticks(0, 10, armed=True), START_NS)])
    (path,) = harness.files()
    moved = path.rename(tmp_path / "moved.mcap")
    harness.log._store([Batch(ticks(500, 10, armed=True), START_NS)])
    assert is_closed(moved)
    assert len(list(read_log(moved, ["/quad1/imu"]))) == 10
    (new,) = harness.files()
    assert new.name == "quad1_20260528T202641_000Z.mcap"
    harness.log._finish()
    harness.log._store([Batch(ticks(2000, 10, armed=False), START_NS)])
    assert harness.log.problem.startswith(f"{path} was removed, moved")
    harness.log._store([Batch(ticks(3000, 10, armed=True), START_NS)])
    assert harness.log.problem == "", "the next flight is whole"
    harness.log._finish()


def test_a_log_removed_after_landing_is_told_and_none_begins(tmp_path: Path) -> None:
    harness = Harness(tmp_path)
    harness.log.close()
    harness.log._store([Batch(ticks(0, 10, armed=True), START_NS)])
    harness.files()[0].unlink()
    harness.log._store([Batch(ticks(10, 300, armed=False), START_NS)])
    assert harness.files() == []
    assert [text.split(":")[0] for _, text in harness.said] == [
        "onboard log quad1_20260528T202640_000Z.mcap started",
        "onboard log stopped",
    ]
    assert harness.said[1][0] == 40


def test_a_folder_that_cannot_be_made_again_stops_the_log(tmp_path: Path) -> None:
    harness = Harness(tmp_path)
    harness.log.close()
    harness.log._store([Batch(ticks(0, 10, armed=True), START_NS)])
    shutil.rmtree(harness.log.folder)
    harness.log.folder.write_text("in the way")
    for second in (1, 2, 3):
        harness.log._store([Batch(ticks(500 * second, 10, armed=True), START_NS)])
    stopped = [text for level, text in harness.said if level == 40]
    assert stopped[0].startswith(f"onboard log stopped: cannot use {harness.log.folder}: ")
    assert "was removed, moved or replaced" in stopped[1]
    assert len(stopped) == 2
    assert harness.log.problem in stopped[0]


def test_a_log_torn_by_a_full_disk_is_mended_on_the_ground(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int, data: bytes) -> int:
        if os.readlink(f"/proc/self/fd/{descriptor}").endswith(".mcap"):
            raise OSError(28, "No space left on device")
        return write(descriptor, data)

    write, told, free = os.write, Notification(), [10 * FREE_BYTES_MIN]
    log = OnboardLog(tmp_path, "quad1", {}, told, free=lambda _: free[0])
    log._store([Batch(ticks(0, 10, armed=True), START_NS)])
    with monkeypatch.context() as failing:
        failing.setattr(os, "write", full)
        log._store([Batch(ticks(10, 10, armed=True), START_NS)])
    assert (
        "onboard log not closed; it is repaired once the vehicle is disarmed: cannot"
        in (told.lines[-1])
    )
    (path,) = log.folder.iterdir()
    assert not is_closed(path)
    log.repair._clock = lambda: math.inf  # no pause is too long
    log._maintain(on_ground=False)
    assert log.repair._process is None, "never while armed"
    free[0] = 0
    log._store([Batch(ticks(20, 300, armed=False), START_NS)])
    log._maintain(on_ground=True)
    assert "is repaired once 500 MB are free on the vehicle's disk (0 MB are" in log.repair.state
    free[0] = 10 * FREE_BYTES_MIN
    log._maintain(on_ground=True)
    assert log.repair.state == "is being repaired"
    assert [written.path for written in log.files()] == [path]
    process = now(log).repair._process
    assert process is not None
    end = time.monotonic() + 3 * BOUND
    while not process.poll(1.0):
        assert time.monotonic() < end
    log._maintain(on_ground=True)
    assert is_closed(path)
    assert len(list(read_log(path, ["/quad1/imu"]))) == 10
    assert log.files() == [], "its places are those of the torn file"
    assert f"onboard log {path.name} recovered: 40 messages" in told.lines
