"""A hundred breaks of the link: what arrives after each, and how soon each end notices it.

Part of `python -m benchmarks link`.
"""

from __future__ import annotations

import random
import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.link.ends import Plan
from benchmarks.link.notes import MS, Found, p50
from benchmarks.link.run_ends import Running, running

COUNT = 100, 5, 1  # of each size
SHORTEST, BETWEEN = 0.5, 2.0  # s
LONGEST = 10.0, 10.0, 1.0  # s, of each size
CALL_RATE = 20.0
"""Rate, in Hz, of calls: the first answer after an outage must be seen in time."""
FRESH = 250.0  # ms
WARM = 3
"""Number of outages before memory is measured: buffers have reached their size by then."""


@dataclass(frozen=True)
class Outage:
    """Start and end of an outage, ns."""

    begin: int
    end: int


def outages(size: Size = Size.FULL) -> Report:
    """Measure fresh data and answers after each outage, memory, and when each end noticed it."""
    count = size.of(*COUNT)
    drawn = random.Random(8)
    lengths = [drawn.uniform(SHORTEST, size.of(*LONGEST)) for _ in range(count)]
    seconds = sum(lengths) + (BETWEEN + 1.0) * count + 60.0
    with running(Plan(seconds, udp=False, call_rate=CALL_RATE)) as ends:
        broken: list[Outage] = []
        before = ends.memory()
        for k, length in enumerate(lengths):
            broken.append(_break(ends, length, drawn.uniform(0.0, 0.1)))
            if k == min(WARM, count // 2):
                before = ends.memory()
        after = ends.memory()
        growth = after[0] - before[0], after[1] - before[1]
        found = ends.finish()
    return _report(found, broken, growth)


def _break(ends: Running, length: float, more: float) -> Outage:
    """Break the link and return the outage.

    Args:
        more: s, an extra pause, so that heartbeats do not always stop at the same moment.
    """
    begin = time.monotonic_ns()
    ends.link.interrupt(length)
    time.sleep(length + BETWEEN + more)
    return Outage(begin, begin + round(length * 1e9))


def _report(found: Found, broken: list[Outage], growth: tuple[float, float]) -> Report:
    fresh = np.array([first_fresh(found, one) for one in broken])
    answered = np.array([first_answer(found, one) for one in broken])
    at_station = np.array([noticed(found.states, one) for one in broken])
    at_vehicle = np.array([noticed(found.silences, one) for one in broken])
    shown = found.telemetry[found.telemetry[:, 3] == 1]
    stale = int(((shown[:, 2] - shown[:, 1]) * MS > FRESH).sum())
    report = Report("outages", "Outages", [f"{len(broken)} outages of 0.5 to 10 s, 2 s between"])
    report.rows.append(
        Row(
            f"{len(broken)} outages, longest of all (median)",
            {
                "fresh after, ms": _both(fresh),
                "answer after, ms": _both(answered),
                "station knows after, ms": _both(at_station),
                "vehicle knows after, ms": _both(at_vehicle),
            },
        )
    )
    report.targets = [
        Target("outages: fresh data after, longest, ms", float(fresh.max()), 500.0),
        Target("outages: call answered after, longest, ms", float(answered.max()), 500.0),
        Target("outages: shown though older than 250 ms", stale, 0),
        Target("outages: memory of the vehicle, + MB", growth[0], 8.0),
        Target("outages: memory of the station, + MB", growth[1], 8.0),
        Target("outages: station knows after, longest, ms", float(at_station.max()), 300.0),
        Target("outages: vehicle knows after, longest, ms", float(at_vehicle.max()), 500.0),
    ]
    if stale:
        late = shown[(shown[:, 2] - shown[:, 1]) * MS > FRESH]
        report.notes.append(
            f"older than 250 ms when handed on: at most {(late[:, 2] - late[:, 1]).max() * MS:.0f} "
            f"ms, {int(late[:, 4].sum())} of {stale} by datagrams"
        )
    return report


def first_fresh(found: Found, outage: Outage) -> float:
    """Return the ms from the outage's end to telemetry that was to be shown; inf without any."""
    rows = found.telemetry
    came = rows[(rows[:, 2] >= outage.end) & (rows[:, 3] == 1), 2]
    return _since(came, outage.end)


def first_answer(found: Found, outage: Outage) -> float:
    """Return the ms from the end of the outage to an answer, whenever it was requested."""
    calls = found.calls[found.calls[:, 1] >= 0]
    answered = calls[:, 0] + calls[:, 1]
    return _since(answered[answered >= outage.end], outage.end)


def noticed(changes: npt.NDArray[np.int64], outage: Outage) -> float:
    """Return the ms from the start of the outage until one end noticed it; inf if it did not."""
    after = changes[(changes[:, 0] >= outage.begin) & (changes[:, 1] > 0), 0]
    return _since(after, outage.begin)


def _since(times: npt.NDArray[np.int64], begin: int) -> float:
    return float((times.min() - begin) * MS) if len(times) else float("inf")


def _both(values: npt.NDArray[np.float64]) -> str:
    return f"{values.max():.0f} ({p50(values):.0f})"
