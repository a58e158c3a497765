"""Torn onboard logs are repaired on the ground: when, by what, and what is reported."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from flight_log import LogWriter, is_closed, read_log, read_metadata
from vehicle.mailbox import INFO, WARN
from vehicle.onboard_log.repair import (
    FIRST_S,
    LATER,
    NOW,
    PERIOD_S,
    SOON,
    TRIES,
    LogRepair,
    start_repair,
)

BOUND = 30.0
"""Time, in s, after which a waiting test fails."""
KEEP = 500_000_000


def torn_log(folder: Path, name: str = "quad1_a") -> Path:
    """Write a log of 100 messages without an end."""
    path = folder / "onboard" / f"{name}.mcap"
    writer = LogWriter(path, {"run_id": name}, {})
    for k in range(100):
        writer.write("/quad1/text", "std_msgs/msg/String", b"\0\1\0\0\2\0\0\0a\0", k, k)
    writer.close_chunk()
    writer._file.close()
    return path


class Process:
    """Process that ends when the test requests it."""

    def __init__(self, told: Callable[[str], None]) -> None:
        self.told = told
        self.ended = False
        self.terminated = 0

    def poll(self) -> bool:
        return self.ended

    def terminate(self) -> None:
        self.terminated += 1


class Harness:
    def __init__(self, folder: Path) -> None:
        self.now_s, self.free = 1000.0, 2 * KEEP
        self.said: list[tuple[int, str]] = []
        self.begun: list[list[Path]] = []
        self.process: Any = None
        self.repair = LogRepair(
            folder,
            lambda level, text: self.said.append((level, text)),
            lambda _: self.free,
            lambda: KEEP,
            lambda: self.now_s,
            self._begin,
        )

    def _begin(self, paths: Sequence[Path], told: Callable[[str], None]) -> Any:
        self.begun.append(list(paths))
        self.process = Process(told)
        return self.process

    def after(self, seconds: float, *, on_ground: bool = True) -> list[Path]:
        self.now_s += seconds
        return self.repair.step(on_ground)

    def end(self, *lines: str) -> None:
        self.process.ended = True
        for line in lines:
            self.process.told(line)


def test_what_the_start_did_not_mend_is_tried_again_on_the_ground_only(tmp_path: Path) -> None:
    path, harness = torn_log(tmp_path), Harness(tmp_path)
    harness.after(10 * FIRST_S, on_ground=False)
    harness.after(0.0)
    harness.after(FIRST_S - 1.0)
    assert (harness.begun, harness.repair.state) == ([], SOON)
    harness.after(1.0)
    assert (harness.begun, harness.repair.state) == ([[path]], NOW)


def test_a_log_torn_now_is_mended_at_once_when_on_the_ground(tmp_path: Path) -> None:
    path, harness = torn_log(tmp_path), Harness(tmp_path)
    harness.repair.note_torn()
    harness.after(3600.0, on_ground=False)
    assert harness.begun == []
    harness.after(0.0)
    assert harness.begun == [[path]]
    assert harness.after(1.0) == [], "it is under way"
    path.unlink()
    harness.end("onboard log quad1_a.mcap removed: it holds nothing, its writer was killed")
    assert harness.after(1.0) == [path]
    assert harness.said == [
        (INFO, "onboard log quad1_a.mcap removed: it holds nothing, its writer was killed")
    ]
    harness.after(1e6)
    assert len(harness.begun) == 1, "nothing is torn any more"


def test_it_waits_for_room_and_says_how_much(tmp_path: Path) -> None:
    path, harness = torn_log(tmp_path), Harness(tmp_path)
    need = path.stat().st_size + KEEP
    harness.free = need - 1
    harness.repair.note_torn()
    harness.after(0.0)
    assert harness.begun == []
    assert harness.repair.state == (
        "is repaired once 500 MB are free on the vehicle's disk (500 MB are: delete old runs there)"
    )
    harness.free = 300_000_000
    for _ in range(10 * TRIES):
        harness.after(PERIOD_S)
    assert "once 500 MB are free on the vehicle's disk (300 MB are" in harness.repair.state
    harness.free = need
    harness.after(PERIOD_S / 2)
    assert harness.begun == []
    harness.after(PERIOD_S / 2)
    assert harness.begun == [[path]]


def test_arming_ends_it_and_the_next_landing_begins_it_again(tmp_path: Path) -> None:
    path, harness = torn_log(tmp_path), Harness(tmp_path)
    harness.repair.note_torn()
    harness.after(0.0)
    for _ in range(3):
        harness.after(0.025, on_ground=False)
    assert (harness.process.terminated, harness.repair.state) == (1, SOON)
    harness.end()
    assert harness.after(0.025, on_ground=False) == []
    harness.after(3600.0, on_ground=False)
    assert len(harness.begun) == 1
    harness.after(0.0)
    assert harness.begun == [[path], [path]]


def test_what_cannot_be_mended_is_said_once_and_given_up_in_the_end(tmp_path: Path) -> None:
    torn_log(tmp_path)
    harness, begun_s = Harness(tmp_path), []
    harness.repair.note_torn()
    for second in range(3000):
        before = len(harness.begun)
        harness.after(1.0)
        if len(harness.begun) > before:
            begun_s.append(second)
            harness.end("onboard log quad1_a.mcap not recovered: no room")
    pauses = [b - a for a, b in pairwise(begun_s)]
    assert pauses == [1 + PERIOD_S * 2**k for k in range(TRIES - 1)]
    assert harness.repair.state == LATER
    assert harness.said == [(WARN, "onboard log quad1_a.mcap not recovered: no room")]
    harness.repair.note_torn()
    harness.after(1.0)
    assert len(harness.begun) == TRIES + 1, "another flight's log is tried anew"


def test_without_torn_logs_nothing_is_begun(tmp_path: Path) -> None:
    harness = Harness(tmp_path)
    for seconds in (0.0, FIRST_S, 1e6):
        harness.after(seconds)
    assert harness.begun == []
    assert harness.repair._due_s == math.inf


def test_the_process_mends_and_tells_at_the_lowest_priority(tmp_path: Path) -> None:
    path = torn_log(tmp_path)
    told: list[str] = []
    start_repair([path], told.append).result()
    assert told == ["onboard log quad1_a.mcap recovered: 100 messages"]
    assert is_closed(path)
    assert len(list(read_log(path))) == 100
    assert "quadlab.recovered" in read_metadata(path)
    assert os.listdir(path.parent) == [path.name]


def test_closing_ends_the_process(tmp_path: Path) -> None:
    path, harness = torn_log(tmp_path), Harness(tmp_path)
    processes = []

    def begin(paths: Sequence[Path], told: Callable[[str], None]) -> Any:
        processes.append(start_repair(paths, told))
        return processes[0]

    harness.repair._begin = begin
    harness.repair.note_torn()
    harness.after(0.0)
    harness.repair.close()
    (process,) = processes
    assert process.poll()
    assert len(list(read_log(path))) == 100, "torn or mended, nothing is lost"
    harness.repair.close()
