"""Measure the cost of the onboard log at 5000 messages a second, and its effect on the flight loop.

    python -m benchmarks onboard_log

A real flight process flies the figure 8; this process is its comms. In turns it logs and does not:
four topics of every tick through `OnboardLog.ticks`, six more of 200 bytes through `message`, to a
file on the disk of the temporary folder; or all of them to nothing.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.onboard.flight_under_test import FlightUnderTest
from flight_log.summary import summarize
from quadrotor.errors import QuadlabError
from quadrotor.records import Record
from vehicle.onboard_log.onboard_log import OnboardLog
from vehicle_link.topics.table import TOPICS

RATE = 500
SECONDS = 60.0, 6.0, 1.5  # of each size
TURNS = 3, 3, 1  # with the log, and as many without, of each size
PAYLOAD_BYTES = 200
OTHERS = ("estimator", "battery", "pressure", "bearing_pose", "tracker_pose", "joy")
PAYLOADS = 500  # different ones of each: more than the compressor's window
TICK_TOPICS = 4
MESSAGES = TICK_TOPICS + len(OTHERS)  # a tick
SHARE = 6.0
"""Limit of processor time, in % of a core."""
RATIO = 1.25
"""Limit of lateness with the log over that without: two equal runs on a busy machine differ by it.
"""


@dataclass
class Turn:
    """A turn of measurement: one part of the flight."""

    began_ns: int
    ended_ns: int = 0
    busy: float = 0.0  # s of processor time of this process


class NoLog:
    """Log that stores nothing: measures the cost of preparing and passing messages alone."""

    def ticks(self, ticks: Record, log_ns: int) -> None:
        pass

    def message(
        self, topic: str, type_name: str, payload: bytes, source_ns: int, log_ns: int
    ) -> None:
        pass


@dataclass
class Logged:
    """A log under test: its input and its results."""

    log: OnboardLog | NoLog
    said: list[str]
    payloads: list[list[bytes]]  # one row a tick, in turn
    handed: int = 0  # ticks, each with its messages
    kept: int = 0  # messages
    bytes: int = 0
    handing_s: list[float] = field(default_factory=list)
    slowest_sync: float = 0.0

    def heard(self, ticks: Record) -> None:
        """Log ticks as the comms process passes on what it reads."""
        if not ticks["status"]["armed"].all():
            raise QuadlabError("the vehicle has landed; is the machine too busy to fly?")
        began = time.perf_counter()
        now_ns = int(ticks["imu"]["stamp_ns"][-1]) + 1_000_000
        self.log.ticks(ticks, now_ns)
        for number, stamp_ns in enumerate(ticks["imu"]["stamp_ns"].tolist(), self.handed):
            row = self.payloads[number % PAYLOADS]
            for topic, payload in zip(OTHERS, row, strict=True):
                self.log.message(topic, TOPICS[topic].type_name, payload, stamp_ns, now_ns)
        self.handing_s.append(time.perf_counter() - began)
        self.handed += len(ticks)

    def close(self) -> None:
        assert isinstance(self.log, OnboardLog)
        file = self.log._file
        self.slowest_sync = 0.0 if file is None else file._sync.slowest
        self.log.close()
        for written in self.log.files():
            summary = summarize(written.path)
            self.kept += summary.message_count
            self.bytes += summary.bytes
            written.path.unlink()


def run(size: Size = Size.FULL) -> Report:
    """Measure turns of the size's `SECONDS` in all with the log, and as long without."""
    seconds, turns = size.of(*SECONDS), size.of(*TURNS)
    report = Report(
        "onboard_log",
        "Onboard log at 5000 messages a second",
        [
            f"{seconds} s with the log and as long without, in {turns} turns each of one "
            f"flight: figure 8, {RATE} Hz, simulated vehicle inside the flight process",
            f"{TICK_TOPICS} topics of every tick and {len(OTHERS)} of {PAYLOAD_BYTES} B (random: "
            "nothing to compress) at the same rate",
            "% of a core: processor time of the process that reads the ring and logs; without, it "
            "hands the same messages to a log that keeps nothing",
            "lateness: of the flight loop, from the absolute deadline to the first line it runs",
        ],
    )
    random = np.random.default_rng(1)
    payloads = [[random.bytes(PAYLOAD_BYTES) for _ in OTHERS] for _ in range(PAYLOADS)]
    flown: dict[bool, list[Turn]] = {False: [], True: []}
    logs: list[Logged] = []
    with tempfile.TemporaryDirectory() as folder, FlightUnderTest(Path(folder), RATE) as flight:
        flight.take_off()
        first = _logged(folder, payloads)  # warms up caches
        _fly(flight, 1.0, first.heard)
        first.close()
        for _ in range(turns):
            unlogged = Logged(NoLog(), [], payloads)
            flown[False].append(_fly(flight, seconds / turns, unlogged.heard))
            logs.append(_logged(folder, payloads))
            flown[True].append(_fly(flight, seconds / turns, logs[-1].heard))
            logs[-1].close()
        rights = flight.rights
        ticks = flight.stop()["ticks"]
    _add(report, flown, logs, ticks)
    report.notes.append(f"flight process: {rights}")
    return report


def _logged(folder: str, payloads: list[list[bytes]]) -> Logged:
    said: list[str] = []
    log = OnboardLog(Path(folder), "quad1", {}, lambda level, text: said.append(text))
    log.start()
    return Logged(log, said, payloads)


def _fly(flight: FlightUnderTest, seconds: float, heard: Callable[[Record], None]) -> Turn:
    turn, busy = Turn(time.monotonic_ns()), time.process_time()
    flight.heard = heard
    flight.fly(seconds)
    flight.heard = lambda ticks: None
    turn.ended_ns, turn.busy = time.monotonic_ns(), time.process_time() - busy
    return turn


def _add(
    report: Report, turns: dict[bool, list[Turn]], logs: list[Logged], ticks: npt.NDArray[np.int64]
) -> None:
    share, late = {}, {}
    for with_log, its in turns.items():
        seconds = 1e-9 * sum(turn.ended_ns - turn.began_ns for turn in its)
        share[with_log] = 100.0 * sum(turn.busy for turn in its) / seconds
        flown = np.concatenate(
            [ticks[(ticks[:, 1] >= t.began_ns) & (ticks[:, 1] < t.ended_ns)] for t in its]
        )
        late[with_log] = 1e-3 * (flown[:, 2] - flown[:, 1])
        report.rows.append(
            Row(
                "with the log" if with_log else "without",
                {
                    "% of a core": share[with_log],
                    "lateness p50, µs": float(np.median(late[with_log])),
                    "p99": float(np.percentile(late[with_log], 99)),
                    "99.9 %": float(np.percentile(late[with_log], 99.9)),
                    "messages/s": MESSAGES * sum(log.handed for log in logs) / seconds
                    if with_log
                    else 0.0,
                    "MB/s": 1e-6 * sum(log.bytes for log in logs) / seconds if with_log else 0.0,
                },
            )
        )
    lost = sum(log.handed * MESSAGES - log.kept for log in logs)
    ratio = float(np.percentile(late[True], 99) / np.percentile(late[False], 99))
    report.targets += [
        Target("messages dropped", float(lost), 0.0),
        Target("% of a core for the log (with less without)", share[True] - share[False], SHARE),
        Target("lateness p99 with the log over without", ratio, RATIO),
    ]
    handing = 1e6 * np.concatenate([log.handing_s for log in logs])
    slowest = 1e3 * max(log.slowest_sync for log in logs)
    report.notes += [
        f"handing over a batch of ticks with its other messages: {np.median(handing):.0f} µs, "
        f"p99 {np.percentile(handing, 99):.0f} µs",
        f"fdatasync once a second, on a thread of its own: the slowest {slowest:.1f} ms",
        *(line for log in logs for line in log.said if "lost" in line or "stopped" in line),
    ]
