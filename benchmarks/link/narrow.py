"""A log is downloaded over 2 Mbit/s during telemetry. Part of `python -m benchmarks link`.

Telemetry waits for the part of the download that is on its way: W bytes of it delay telemetry by W
/ (rate - telemetry) seconds, as waiting telemetry also delays the next. With 0.9 of 2 Mbit/s used,
a piece of 2800 B gives 21 ms, two give 43.
"""

from __future__ import annotations

import time

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.impairment.wire import Conditions
from benchmarks.link.ends import Plan
from benchmarks.link.notes import Found, ages, answers, delays, lost, p50, p99, unanswered
from benchmarks.link.run_ends import SETTLED, running
from console.transfers.vehicle_files import PIECE

RATE = 2e6  # bit/s
SECONDS = 30.0, 6.0, 1.0  # of each size


def narrow(size: Size = Size.FULL) -> Report:
    """Return telemetry's delay, and the share of the remaining rate that the download gets."""
    seconds = size.of(*SECONDS)
    with running(Plan(2 * seconds + 30.0, udp=False)) as ends:
        ends.link.change(Conditions(rate=RATE))
        time.sleep(SETTLED)
        quiet = time.monotonic_ns()
        carried = -ends.link.counts()[0].bytes
        time.sleep(seconds)
        carried += ends.link.counts()[0].bytes
        ends.start_download()
        time.sleep(1.0)
        begin = time.monotonic_ns()
        time.sleep(seconds)
        end = time.monotonic_ns()
        time.sleep(SETTLED)
        found = ends.finish()
    left = RATE / 8 - carried / ((begin - quiet) * 1e-9 - 1.0)  # B/s
    busy = found.between(begin, end)
    got = float(busy.download[:, 1].sum()) / ((end - begin) * 1e-9)
    report = Report(
        "narrow",
        "2 Mbit/s",
        [f"download over 2 Mbit/s: pieces of {PIECE} B, as the station fetches a log"],
    )
    report.rows = [
        _row("2 Mbit/s", found.between(quiet, begin)),
        _row("2 Mbit/s, a log being downloaded", busy),
    ]
    report.rows[1].figures["download, kB/s"] = got / 1e3
    report.rows[1].figures["of what is left, %"] = 100.0 * got / left
    report.targets = [
        Target("2 Mbit/s with a download: telemetry p99, ms", p99(delays(busy.telemetry)), 30.0),
        Target("2 Mbit/s with a download: telemetry lost, %", lost(busy.telemetry), 0.0),
        Target("2 Mbit/s with a download: calls p99, ms", p99(answers(busy.calls)), 50.0),
        Target("2 Mbit/s: download, % of what is left", 100.0 * got / left, 80.0, at_most=False),
    ]
    return report


def _row(method: str, found: Found) -> Row:
    return Row(
        method,
        {
            "delay p50, ms": p50(delays(found.telemetry)),
            "delay p99, ms": p99(delays(found.telemetry)),
            "age p99, ms": p99(ages(found.telemetry)),
            "lost, %": lost(found.telemetry),
            "poses: age p99, ms": p99(ages(found.poses)),
            "calls p99, ms": p99(answers(found.calls)),
            "calls unanswered": unanswered(found.calls),
        },
    )
