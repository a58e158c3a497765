"""Telemetry, poses and calls over a link that loses, delays, narrows and breaks, compared with UDP.

    python -m benchmarks link

Four parts, each reported when it is done: the links, outages, a run filled after outages, a narrow
link. Real processes in two network namespaces (benchmarks/impairment): the project's own way from
the vehicle's radio to the station's monitor (benchmarks/link/ends.py), and over QUIC alone, without
the lane of datagrams, in separate runs. Delay is from before the sending call to the receiving
callback, for received messages; age is that of the newest message, sampled each millisecond. Needs
root.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.impairment.wire import Conditions
from benchmarks.link.ends import Plan
from benchmarks.link.narrow import narrow
from benchmarks.link.notes import (
    Found,
    Rows,
    ages,
    answers,
    beside,
    delays,
    lost,
    p50,
    p99,
    unanswered,
)
from benchmarks.link.outages import outages
from benchmarks.link.run_ends import SETTLED, running
from benchmarks.logs.filled import filled
from quadrotor.errors import QuadlabError

SECONDS = 60.0, 6.0, 1.0  # of each size
CLEAN = "clean"
LINKS = {
    CLEAN: Conditions(),
    "10 ± 5 ms, 5 % lost": Conditions(delay=0.010, jitter=0.005, loss=0.05),
    "20 % lost, each for itself": Conditions(loss=0.2),
    "20 % lost, in 80 ms bursts": Conditions(loss=0.2, burst=0.08),
}
BUSY = 2.0
"""Delay, in ms, of plain UDP on a clean link from which the machine was busy, not the link."""
PROMPT = 1.0
"""Delay, in ms, of plain UDP when the machine is not busy."""


def run(size: Size = Size.FULL) -> Iterator[Report]:
    """Yield each part's report; a part whose end fails misses its target, others continue."""
    for part in (links, outages, filled, narrow):
        try:
            yield part(size)
        except QuadlabError as error:
            name = part.__name__
            failed = Target(f"{name}: ended by an error", 1.0, 0.0)
            yield Report(name, name.title(), [f"{error}"], targets=[failed])


def links(size: Size = Size.FULL) -> Report:
    """Measure links under all conditions.

    Raises StorageError where namespaces are not allowed, QuadlabError when an end fails.
    """
    seconds = size.of(*SECONDS)
    report = Report(
        "link",
        "The link, impaired",
        [
            f"{seconds:.0f} s each; telemetry of 1048 B and poses at 100 Hz next to as many bytes "
            "by plain UDP, half a period later",
            "delay of what came; age of the newest, each ms, telemetry at the station and poses "
            "at the vehicle; 5 calls a second, asked again after 1 s",
        ],
    )
    found: dict[str, Found] = {}
    for name, conditions in size.some(LINKS.items()):
        found[name] = with_lane = measure(conditions, Plan(seconds + 30.0), seconds)
        alone = measure(conditions, Plan(seconds + 30.0, lane=False, udp=False), seconds)
        ours = with_lane.telemetry
        report.rows += [
            _row(f"{name}: this project", ours, with_lane.poses, with_lane.calls),
            _row(f"{name}: over QUIC alone", alone.telemetry, alone.poses, alone.calls),
            _row(f"{name}: plain UDP", with_lane.udp, with_lane.udp_poses),
        ]
        by_lane = 100.0 * ours[:, 4].mean()
        report.notes.append(f"{name}: {by_lane:.1f} % of the telemetry came as datagrams")
    report.targets = _targets(found)
    report.notes += _busy(found[CLEAN])
    return report


def _busy(clean: Found) -> list[str]:
    """Return notes about a machine that was busy at times; targets are not affected."""
    udp = p99(delays(clean.udp))
    if udp <= BUSY:
        return []
    prompt = beside(clean.telemetry, clean.udp, PROMPT)
    if not len(prompt):
        return ["the machine was busy all the time"]
    share = 100.0 * len(prompt) / len(clean.telemetry)
    return [
        f"the machine was busy: plain UDP took {udp:.1f} ms on a clean link. Of the {share:.0f} % "
        f"of telemetry sent between two packets of it that took at most {PROMPT:g} ms: p99 "
        f"{p99(delays(prompt)):.2f} ms"
    ]


def measure(conditions: Conditions, plan: Plan, seconds: float) -> Found:
    """Return the notes of `seconds` under these conditions."""
    with running(plan) as ends:
        ends.link.change(conditions)
        time.sleep(SETTLED)
        begin = time.monotonic_ns()
        time.sleep(seconds)
        end = time.monotonic_ns()
        ends.link.change(Conditions())
        time.sleep(SETTLED)  # for messages on their way
        return ends.finish().between(begin, end)


def _row(method: str, telemetry: Rows, poses: Rows, calls: Rows | None = None) -> Row:
    figures: dict[str, float | str] = {
        "delay p50, ms": p50(delays(telemetry)),
        "delay p99, ms": p99(delays(telemetry)),
        "age p99, ms": p99(ages(telemetry)),
        "lost, %": lost(telemetry),
        "poses: age p99, ms": p99(ages(poses)),
    }
    if calls is not None:
        figures["calls p99, ms"] = p99(answers(calls))
        figures["calls unanswered"] = unanswered(calls)
    return Row(method, figures)


def _targets(found: dict[str, Found]) -> list[Target]:
    missing = sum(unanswered(one.calls) for one in found.values())
    answered = Target("calls unanswered, all links", missing, 0)
    if len(found) < len(LINKS):
        return [answered]
    clean, noisy, lossy, bursts = found.values()

    def late(rows: Rows) -> float:
        return p99(delays(rows))

    return [
        Target("clean: delay p99, ms", late(clean.telemetry), 2.0),
        Target("5 %: delay p99 over plain UDP's, ms", late(noisy.telemetry) - late(noisy.udp), 1.0),
        Target("20 %: delay p99, ms", late(lossy.telemetry), 20.0),
        Target("bursts: age p99, ms", p99(ages(bursts.telemetry)), 300.0),
        Target("20 %: calls p99, ms", p99(answers(lossy.calls)), 250.0),
        Target("bursts: calls p99, ms", p99(answers(bursts.calls)), 1500.0),
        answered,
    ]
