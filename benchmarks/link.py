"""Telemetry and calls over a link that loses, delays, narrows: the project's session and plain UDP.

    python -m benchmarks link

Real processes in two network namespaces (benchmarks/impairment), the project's own sessions over
QUIC with mutual TLS, packets of 1100 B 100 times a second each way of sending them, five calls of a
service a second asked again under the same id. Delay is from before the sending call to the
receiving callback, of the packets that came; age is how old the newest packet is, looked at each
millisecond. Needs root.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.harness import Report, Row, Target
from benchmarks.impairment.link import ROOT, A, B, ImpairedLink
from benchmarks.impairment.wire import Conditions
from quadrotor.errors import QuadlabError
from vehicle_link.authority import ensure_certificates

SECONDS, QUICK_SECONDS = 60.0, 6.0
SETTLED = 2.0
"""s at the start that do not count."""
LINKS = {
    "clean": Conditions(),
    "10 ± 5 ms, 5 % lost": Conditions(delay=0.010, jitter=0.005, loss=0.05),
    "20 % lost, each for itself": Conditions(loss=0.2),
    "20 % lost, in 80 ms bursts": Conditions(loss=0.2, burst=0.08),
}
MS = 1e-6
Notes = npt.NDArray[Any]


def run(quick: bool = False) -> Report:
    """Raises StorageError where namespaces are not allowed, QuadlabError when an end fails."""
    seconds = QUICK_SECONDS if quick else SECONDS
    report = Report(
        "link",
        "The link, impaired",
        [
            f"{seconds:.0f} s each; telemetry of 1100 B at 100 Hz beside the same by plain UDP",
            "delay of what came; age of the newest, each ms; calls asked again after 1 s",
        ],
    )
    found = {name: measure(conditions, seconds) for name, conditions in LINKS.items()}
    for name, (zenoh, udp, calls) in found.items():
        for way, notes in (("this project", zenoh), ("plain UDP", udp)):
            figures = {
                "delay p50, ms": float(np.percentile(delays(notes), 50)),
                "delay p99, ms": float(np.percentile(delays(notes), 99)),
                "age p99, ms": float(np.percentile(ages(notes), 99)),
                "lost, %": lost(notes),
            }
            if way == "this project":
                answered = calls[calls[:, 1] >= 0, 1] * MS
                figures["calls p99, ms"] = float(np.percentile(answered, 99))
                figures["calls unanswered"] = float((calls[:, 1] < 0).sum())
            report.rows.append(Row(f"{name}: {way}", figures))
    report.targets = _targets(found)
    return report


def _targets(found: dict[str, tuple[Notes, Notes, Notes]]) -> list[Target]:
    clean, noisy, lossy, bursts = found.values()

    def p99(notes: Notes) -> float:
        return float(np.percentile(delays(notes), 99))

    def calls(notes: Notes) -> float:
        return float(np.percentile(notes[notes[:, 1] >= 0, 1] * MS, 99))

    unanswered = sum(int((calls[:, 1] < 0).sum()) for _, _, calls in found.values())
    return [
        Target("clean: delay p99, ms", p99(clean[0]), 2.0),
        Target("5 %: delay p99 over plain UDP's, ms", p99(noisy[0]) - p99(noisy[1]), 1.0),
        Target("20 %: delay p99, ms", p99(lossy[0]), 20.0),
        Target("bursts: age p99, ms", float(np.percentile(ages(bursts[0]), 99)), 300.0),
        Target("20 %: calls p99, ms", calls(lossy[2]), 250.0),
        Target("bursts: calls p99, ms", calls(bursts[2]), 1500.0),
        Target("calls unanswered, all links", unanswered, 0),
    ]


def measure(conditions: Conditions, seconds: float) -> tuple[Notes, Notes, Notes]:
    """(number, sent ns, heard ns) by session and by UDP; (asked, ns until answered) of calls."""
    with tempfile.TemporaryDirectory() as name, ImpairedLink(seed=11) as link:
        folder = Path(name)
        ensure_certificates(folder, [A])
        words = [sys.executable, "-m", "benchmarks.link_ends"]
        more = {"cwd": ROOT, "stdout": subprocess.PIPE}
        vehicle = link.run(A, [*words, "vehicle", name, f"{seconds + 20.0}"], **more)
        _until_up(vehicle)
        station = link.run(B, [*words, "station", name, f"{seconds}"], **more)
        _until_up(station)
        link.change(conditions)
        if station.wait(seconds + 60.0) != 0:
            raise QuadlabError("the station's end of the link failed; see its lines above")
        with np.load(folder / "notes.npz") as notes:
            zenoh, udp, calls = notes["zenoh"], notes["udp"], notes["calls"]
    if not len(zenoh) or not len(udp):
        raise QuadlabError("nothing came over the link")
    start = calls[0, 0] + SETTLED * 1e9
    end = calls[-1, 0]
    inside = [rows[(rows[:, 1] >= start) & (rows[:, 1] < end)] for rows in (zenoh, udp)]
    return inside[0], inside[1], calls[(calls[:, 0] >= start)]


def _until_up(program: subprocess.Popen[bytes]) -> None:
    assert program.stdout is not None
    if program.stdout.readline() != b"up\n":
        raise QuadlabError("an end of the link does not start; see its lines above")


def delays(notes: Notes) -> npt.NDArray[np.float64]:
    """ms, of what came."""
    return np.asarray((notes[:, 2] - notes[:, 1]) * MS, np.float64)


def ages(notes: Notes) -> npt.NDArray[np.float64]:
    """ms, how old the newest packet is at each millisecond."""
    heard = notes[np.argsort(notes[:, 2], kind="stable")]
    newest = np.maximum.accumulate(heard[:, 1])
    moments = np.arange(heard[0, 2], heard[-1, 2], 1_000_000)
    at = np.searchsorted(heard[:, 2], moments, side="right") - 1
    return np.asarray((moments - newest[at]) * MS, np.float64)


def lost(notes: Notes) -> float:
    """%, of those between the first and the last that came."""
    numbers = np.unique(notes[:, 0])
    return float(100.0 * (1.0 - len(numbers) / (numbers[-1] - numbers[0] + 1)))
