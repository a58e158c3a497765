"""The onboard log: which ticks are in the file, in which words it stops, what it mends."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from quadrotor.records import TICK, Record
from vehicle import onboard_log
from vehicle.onboard_log import FREE_BYTES_MIN, OnboardLog, recover_logs, torn_logs
from vehicle_link import topics
from vehicle_link.log import is_closed, read_attachments, read_log, read_metadata

START_NS = 1_780_000_000_000_000_000
MS = 1_000_000


def ticks(first: int, count: int, *, armed: bool) -> Record:
    """Ticks numbered from `first`, 2 ms apart."""
    made = np.zeros(count, TICK)
    numbers = np.arange(first, first + count)
    made["sequence"] = numbers
    made["imu"]["stamp_ns"] = START_NS + 2 * MS * numbers
    made["state"]["quaternion_wb"][:, 0] = 1.0
    made["state"]["position_w"][:, 2] = numbers * 1e-3
    made["status"]["armed"] = armed
    return made


class Harness:
    def __init__(self, folder: Path, free: int = 2 * FREE_BYTES_MIN) -> None:
        self.said: list[tuple[int, str]] = []
        self.free = free
        self.folder = folder
        self.log = OnboardLog(
            folder,
            "quad1",
            lambda: b'{"model.mass": 1.3}',
            lambda level, text: self.said.append((level, text)),
            lambda path: self.free,
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
        tmp_path, "quad1", lambda: b"{}", lambda *_: None, lambda _: 2 * FREE_BYTES_MIN,
        calibrations=lambda: in_force.pop(0),
    )  # fmt: skip
    for batch in (
        ticks(0, 5, armed=True), ticks(5, 300, armed=False), ticks(1000, 5, armed=True)
    ):  # fmt: skip
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
    heights = [topics.decode_odometry(m.payload)[1]["position_w"][0, 2] for m in messages]
    assert heights == [k * 1e-3 for k in range(50)]
    assert {m.type_name for m in messages} == {"nav_msgs/msg/Odometry"}
    assert all(m.log_ns == START_NS + 98 * MS + MS for m in messages)


def test_other_topics_are_kept_only_while_a_file_is_open(tmp_path: Path) -> None:
    harness = Harness(tmp_path)
    payload = topics.encode_heartbeat(1, START_NS)

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
        ticks(0, 10, armed=True), ticks(10, 300, armed=False),
        ticks(310, 10, armed=True), ticks(320, 300, armed=False),
    )  # fmt: skip
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
        tmp_path, "quad1", lambda: b"{}", lambda _, text: said.append(text), lambda _: next(answers)
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
        tmp_path, "quad1", lambda: b"{}", lambda _, text: said.append(text), lambda _: next(answers)
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
        tmp_path, "quad1", lambda: parameters["json"], lambda *_: None, lambda _: 2 * FREE_BYTES_MIN
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
    harness.feed(ticks(0, 101, armed=True))  # at once more than it holds
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
