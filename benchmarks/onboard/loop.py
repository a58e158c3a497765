"""Measure how late the flight loop wakes next to two busy processes, compared with cyclictest.

    python -m benchmarks loop

The real flight process, with its simulated vehicle in memory, flies the figure 8 in real time while
two processes keep both cores busy. Lateness is measured from the absolute deadline of a sample to
when the loop wakes for it. cyclictest (Debian: rt-tests) measures the kernel's share, in the same
seconds, at the same interval and priority. Run it as root, or with the real-time rights of
docs/page/setup.md, on an idle machine.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.onboard.flight_under_test import FlightUnderTest, Notes
from vehicle.realtime import PRIORITY

RATES = (500, 1000)
SECONDS = 60, 8, 1  # of each size
HOGS = 2
LONGEST_US = 20_000
P99_US = {500: 150.0, 1000: 100.0}
RATIO = 2.0


def run(size: Size = Size.FULL) -> Report:
    """Measure both rates, without the comparison where cyclictest is missing."""
    seconds, has_peer = size.of(*SECONDS), shutil.which("cyclictest") is not None
    report = Report(
        "loop",
        "The flight loop next to two busy processes",
        [
            f"figure 8 in real time, {seconds} s, simulated vehicle inside the flight process",
            f"{HOGS} busy processes of ordinary priority",
            f"cyclictest in the same seconds, interval of the loop, SCHED_FIFO {PRIORITY} as it",
            "lateness: from the absolute deadline to the first line the loop runs",
            "tick: from there to the command sent and the record in the ring",
        ],
    )
    with tempfile.TemporaryDirectory() as folder:
        for rate in size.some(RATES):
            _measure(report, Path(folder), rate, seconds, has_peer)
    if not has_peer:
        report.notes.append("without cyclictest, which Debian's package rt-tests has")
    return report


def _measure(report: Report, folder: Path, rate: int, seconds: int, has_peer: bool) -> None:
    peer: AbstractContextManager[subprocess.Popen[str] | None] = (
        _cyclictest(1_000_000 // rate, seconds) if has_peer else nullcontext()
    )
    with FlightUnderTest(folder, rate) as flight:
        flight.take_off()
        rights = flight.rights
        with _hogs(), peer as beside:
            began_ns = time.monotonic_ns()
            flight.fly(seconds)
            ended_ns = time.monotonic_ns()
            said = beside.communicate(timeout=30.0)[0] if beside else None
        notes = flight.stop()
    _add(report, rate, _within(notes, began_ns, ended_ns), rights, said)
    overruns, missed, _ = notes["counts"].tolist()
    report.notes.append(
        f"{rate} Hz: {rights}; from the start on {overruns} overruns, {missed} missed frames"
    )


def _add(
    report: Report, rate: int, ticks: npt.NDArray[np.int64], rights: str, said: str | None
) -> None:
    late = 1e-3 * (ticks[:, 2] - ticks[:, 1])
    took = 1e-3 * (ticks[:, 3] - ticks[:, 2])
    p99 = float(np.percentile(late, 99))
    report.rows.append(
        Row(
            f"flight loop, {rate} Hz",
            _figures(late)
            | {
                "tick p50": float(np.median(took)),
                "tick p99": float(np.percentile(took, 99)),
                "ticks": str(len(ticks)),
            },
        )
    )
    report.targets.append(Target(f"lateness at {rate} Hz, p99, µs", p99, P99_US[rate]))
    if said is None:
        return
    peer = histogram(said)
    kernel = float(np.percentile(peer, 99))
    report.rows.append(Row(f"cyclictest, {rate} Hz", _figures(peer) | {"ticks": str(len(peer))}))
    if rate == RATES[0]:
        report.targets.append(Target(f"… over cyclictest's p99 ({rights})", p99 / kernel, RATIO))
    else:
        report.notes.append(f"{rate} Hz: p99 is {p99 / kernel:.2f} times that of cyclictest")


def _within(notes: Notes, began_ns: int, ended_ns: int) -> npt.NDArray[np.int64]:
    ticks = notes["ticks"]
    return ticks[(ticks[:, 1] >= began_ns) & (ticks[:, 1] < ended_ns)]


def _figures(late_us: npt.NDArray[np.floating | np.signedinteger]) -> dict[str, float | str]:
    return {
        "p50, µs": float(np.median(late_us)),
        "p99, µs": float(np.percentile(late_us, 99)),
        "99.9 %, µs": float(np.percentile(late_us, 99.9)),
        "longest, µs": float(late_us.max()),
    }


@contextmanager
def _hogs() -> Iterator[None]:
    program = "import os; os.setpriority(os.PRIO_PROCESS, 0, 0)\nwhile True: pass"
    hogs = [subprocess.Popen([sys.executable, "-c", program]) for _ in range(HOGS)]
    try:
        yield
    finally:
        for hog in hogs:
            hog.kill()
            hog.wait()


@contextmanager
def _cyclictest(interval_us: int, seconds: int) -> Iterator[subprocess.Popen[str]]:
    words: Sequence[object] = (
        "cyclictest",
        "--mlockall",
        "--quiet",
        "--threads=1",
        f"--priority={PRIORITY}",
        f"--interval={interval_us}",
        f"--duration={seconds}",
        f"--histogram={LONGEST_US}",
    )
    with subprocess.Popen(list(map(str, words)), stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()


def histogram(said: str) -> npt.NDArray[np.int64]:
    """Return the latencies (µs) in the output of `cyclictest --histogram`, one per cycle."""
    rows = re.findall(r"^(\d+)\s+(\d+)$", said, re.MULTILINE)
    latencies = [np.repeat(np.int64(us), int(count)) for us, count in rows]
    over = re.search(r"^# Histogram Overflows: 0*(\d+)$", said, re.MULTILINE)
    longest = re.search(r"^# Max Latencies: 0*(\d+)$", said, re.MULTILINE)
    if over and longest:
        latencies.append(np.repeat(np.int64(longest[1]), int(over[1])))
    return np.concatenate(latencies)
