"""Figure 8s flown under `quadlab up` on a machine with too much to do.

    python -m benchmarks starved
    python -m benchmarks.flights.starved --flights 20 [--real-time]     # as it is without lockstep

Two busy loops a core, and the page in a headless Chromium that draws its 3D view in software. The
laboratory has no more rights than an ordinary user's (no SCHED_FIFO, no better niceness). Flights
are judged by their runs: each from arming to motors off, by the truth.
"""

from __future__ import annotations

import argparse
import math
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harness import CHROMIUM, Report, Row, Size, Target
from benchmarks.safety.laboratory import PATIENCE, Laboratory
from flight_log.index import is_closed
from flight_log.reader import read_log
from vehicle_link.messages import decode
from vehicle_link.topics.control_inputs import decode_external_reference
from vehicle_link.topics.ticks import decode_odometry

FLIGHTS, UNLOADED = 20, 4
LAPS = 1
BUSY = 2 * (os.cpu_count() or 1)
"""Number of busy loops."""
WARN = 30
DRAWN_IN_SOFTWARE = (
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
TOLD = ("degraded", "lost", "stale", "silent", "age", "link", "tracker")
"""Words in flags and alarms that concern link, tracker or poses."""


@dataclass
class Flight:
    """One flight, as its run shows it."""

    is_whole: bool = False
    error: float = math.nan  # m, rms
    largest: float = math.nan  # m
    false_events: list[str] = field(default_factory=list)
    factor: float = math.nan  # simulated over real time


def fly(laboratory: Laboratory) -> Flight:
    """Fly one figure 8 from the ground to the ground."""
    flight, known = Flight(), set(_runs(laboratory))
    laboratory.take_off()
    laboratory.until(
        "hover", lambda: laboratory.status().get("behavior") == "hover" or laboratory.is_down()
    )
    eight = {"trajectory": "figure_eight", "laps": LAPS}
    laboratory.until(
        "the figure 8",
        lambda: (
            laboratory.status().get("behavior") != "hover"
            or laboratory.starts("follow_trajectory", **eight)
        ),
    )
    laboratory.until("the start", lambda: laboratory.status().get("behavior") != "hover")
    factors: list[float] = []

    def flown() -> bool:
        summary = laboratory.summary()
        factors.append((summary.get("station") or {}).get("real_time_factor") or 1.0)
        status = summary.get("status") or {}
        return bool(status) and status["behavior"] != "follow_trajectory"

    laboratory.until("its end", flown)
    laboratory.until(
        "landing",
        lambda: (
            laboratory.starts("land")
            or laboratory.status().get("behavior") == "land"
            or laboratory.is_down()
        ),
    )
    laboratory.until("the ground", laboratory.is_down)
    path = laboratory.until(
        "its run", lambda: [p for p in _runs(laboratory) if p not in known and is_closed(p)]
    )
    judge(flight, path[0])
    flight.factor = float(np.mean(factors))
    return flight


def _runs(laboratory: Laboratory) -> list[Path]:
    return [path.parent for path in (laboratory.data / "runs").glob("*/station.mcap")]


def judge(flight: Flight, run: Path) -> None:
    """Evaluate a flight by its run's file: completion, error, and wrong reports."""
    rows: dict[str, list[Any]] = {"truth": [], "reference": []}
    behaviors: list[tuple[int, str]] = []
    wanted = ("truth", "reference", "status", "events", "link_status", "station_status")
    for message in read_log(run, {f"/quad1/{name}" for name in wanted}):
        name = message.topic.rsplit("/", 1)[1]
        if name == "truth":
            stamp_ns, state = decode_odometry(message.payload)
            rows["truth"].append((stamp_ns, *state["position_w"][0]))
            continue
        if name == "reference":
            stamp_ns, reference = decode_external_reference(message.payload)
            rows["reference"].append((stamp_ns, *reference["position_w"][0]))
            continue
        told: Any = decode(message.payload, message.type_name)
        if name == "status":
            behaviors.append((message.publish_ns, str(told.behavior)))
            flight.false_events += [f for f in told.flags if any(word in f for word in TOLD)]
        elif name == "events" and told.level >= WARN:
            flight.false_events.append(str(told.msg))
        elif name == "link_status" and str(told.state) != "good":
            flight.false_events.append(f"link {told.state}")
        elif name == "station_status":
            flight.false_events += [a for a in told.alarms if any(word in a for word in TOLD)]
    flown = [stamp for stamp, behavior in behaviors if behavior == "follow_trajectory"]
    after = [behavior for stamp, behavior in behaviors if flown and stamp > flown[-1]]
    truth = np.array(rows["truth"], np.float64)
    asked = np.array(rows["reference"], np.float64)
    if not flown or not len(truth) or not len(asked):
        return
    times, wanted_ns = truth[:, 0], asked[:, 0]
    inside = (times >= flown[0]) & (times <= flown[-1])
    apart = np.column_stack(
        [truth[inside, k] - np.interp(times[inside], wanted_ns, asked[:, k]) for k in (1, 2, 3)]
    )
    distances = np.linalg.norm(apart, axis=1)
    flight.error, flight.largest = float(np.sqrt(np.mean(distances**2))), float(distances.max())
    flight.is_whole = after[:1] == ["hover"] and not any(
        one in after for one in ("brake", "descend", "emergency")
    )


def _ordinary() -> list[str]:
    """Return a command prefix that removes the rights that an ordinary user lacks."""
    if os.geteuid() != 0 or shutil.which("setpriv") is None:
        return []
    return ["setpriv", "--bounding-set", "-sys_nice", "--inh-caps", "-sys_nice", "--"]


@contextmanager
def busy(count: int) -> Iterator[None]:
    """Run this many busy loops."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for process in loops:
            process.kill()
            process.wait()


@contextmanager
def page(address: str) -> Iterator[None]:
    """Open the page in a browser that draws it in software."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(DRAWN_IN_SOFTWARE))
        opened = browser.new_page(viewport={"width": 1440, "height": 900})
        opened.set_default_timeout(1e3 * PATIENCE)
        opened.goto(address)
        opened.wait_for_selector("#behaviors button")
        yield
        browser.close()


def flights(count: int, words: tuple[str, ...], loops: int = 0) -> list[Flight]:
    """Fly and evaluate the flights, starved by busy loops and a page if there are loops.

    Raises QuadlabError.
    """
    found = []
    with tempfile.TemporaryDirectory(prefix="quadlab-starved-") as data:
        laboratory = Laboratory(Path(data), *words, before=_ordinary())
        try:
            if not loops:
                return [_shown(fly(laboratory)) for _ in range(count)]
            with page(laboratory.new_link()), busy(loops):
                for _ in range(count):
                    found.append(_shown(fly(laboratory)))
            return found
        finally:
            laboratory.close()


def _shown(flight: Flight) -> Flight:
    print(flight, file=sys.stderr, flush=True)
    return flight


def run(size: Size = Size.FULL) -> Report:
    return measure(size.of(FLIGHTS, 3, 1), (), *size.of((BUSY, UNLOADED), (BUSY, UNLOADED), (1, 0)))


def measure(
    count: int, words: tuple[str, ...], loops: int = BUSY, most_alone: int = UNLOADED
) -> Report:
    """Measure flights of laboratories.

    Raises QuadlabError when a laboratory or the page does not start.
    """
    report = Report(
        "starved",
        "Figure 8s on a machine with too much to do",
        [
            f"`quadlab up {' '.join(words)}`, figure_eight, {LAPS} lap, each from the ground to "
            "the ground; rights of an ordinary user",
            f"starved: {loops} busy loops and the page drawn in software next to it",
        ],
    )
    alone = flights(min(most_alone, count), words) if most_alone else []
    starved = flights(count, words, loops)
    for name, group in (("alone", alone), ("starved", starved)):
        if not group:
            continue
        errors = [one.error for one in group if one.is_whole]
        report.rows.append(
            Row(
                name,
                {
                    "flown to the end": f"{len(errors)} of {len(group)}",
                    "error rms, mm": 1e3 * float(np.median(errors)) if errors else math.nan,
                    "worst flight's, mm": 1e3 * max(errors, default=math.nan),
                    "false events": float(sum(len(one.false_events) for one in group)),
                    "real-time factor": float(np.median([one.factor for one in group])),
                },
            )
        )
    whole = sum(one.is_whole for one in starved)
    report.targets = [
        Target("flown to the end, starved", whole, len(starved), at_most=False),
        Target("false events, starved", sum(len(one.false_events) for one in starved), 0),
    ]
    if alone:
        ratio = float(np.median([f.error for f in starved]) / np.median([f.error for f in alone]))
        report.targets.append(Target("error, starved over alone", ratio, 1.1))
    reported = sorted({event for one in starved for event in one.false_events})
    report.notes += [f"reported: {event}" for event in reported[:20]]
    return report


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.flights.starved", description=__doc__
    )
    parser.add_argument("--flights", type=int, default=FLIGHTS, metavar="N")
    parser.add_argument("--real-time", action="store_true", help="without lockstep")
    options = parser.parse_args()
    report = measure(options.flights, ("--real-time",) if options.real_time else ())
    print(report.as_markdown())
    return 0 if all(target.met for target in report.targets) else 1


if __name__ == "__main__":
    sys.exit(main())
