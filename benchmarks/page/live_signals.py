"""Measure what the live page shows of a flight against the run's log, and what it costs.

    python -m benchmarks live_signals

One simulated vehicle flies eights in lockstep. A client opens the page's websockets, with the
signals of the default page, and then with 20 signals of every tick. What it received is compared
with the log that the station recorded meanwhile.
"""

from __future__ import annotations

import json
import statistics
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.page.laboratory import Socket, cpu_seconds, memory_mb, processes, started, until
from benchmarks.page.live_frames import read
from benchmarks.page.up_cost import SETTLED, Pilot, pilot
from flight_log.run import Run, read_run

PORT, LINK_PORT = 28091, 28461
ROUNDS, SECONDS = (3, 1, 1), (30.0, 10.0, 2.0)  # of each size
AXES = "xyz"
DERIVED = "= 2*state.position.x"
DEFAULT = [
    [*(f"{of}.position.{a}" for of in ("state", "error") for a in AXES)],
    [*(f"reference.position.{a}" for a in AXES)],
]
"""Series of the default page."""
CHECKED = [["state.position.x", "error.distance", DERIVED]]
MANY = [
    [
        *(f"{of}.{a}" for of in ("state.position", "state.velocity", "state.rate") for a in AXES),
        *(f"error.position.{a}" for a in AXES),
        "error.distance",
    ],
    [*(f"reference.position.{a}" for a in AXES)],
    [*(f"thrust.{m}" for m in ("front", "left", "rear", "right"))],
]
SHOWN = 40
"""Signals of which the default page shows the newest values."""
CORE, KILOBYTES, TICKS = 0.15, 40.0, 99.9
"""Limits: of web's processor time with 20 signals in cores, of the default page in kB/s, and of the
share of the log's ticks that a page gets in %."""

Figures = dict[str, float]


def run(size: Size = Size.FULL) -> Report:
    """Measure with a vehicle in lockstep."""
    found = []
    for _ in range(size.of(*ROUNDS)):
        began = time.monotonic()
        with (
            started(PORT, LINK_PORT, lockstep=True) as (up, lines),
            pilot(lines, PORT, began) as flown,
        ):
            found.append(measure(flown, up, size))
    figures = {key: statistics.median(one[key] for one in found) for key in found[0]}
    report = Report(
        "live_signals",
        "What the live page shows and costs",
        [
            f"one simulated vehicle flies eights in lockstep; {len(found)} starts; medians",
            "processor: of the web process, in cores; the client's own time does not count",
            f"default page: {sum(map(len, DEFAULT))} signals of every tick, the newest of {SHOWN}",
        ],
    )
    report.rows += [Row(key, {"value": value}) for key, value in figures.items()]
    report.targets += [
        Target("20 signals: processor", figures["20 signals: processor"], CORE),
        Target("default page: kB/s", figures["default page: kB/s"], KILOBYTES),
        Target("ticks shown, %", figures["ticks shown, %"], TICKS, at_most=False),
        Target("samples that differ from the log's", figures["samples that differ"], 0.0),
        Target("ticks missing and not told", figures["missing and not told"], 0.0),
    ]
    return report


def measure(flown: Pilot, up: int, size: Size) -> Figures:
    """Fly with pages of several kinds; return the figures."""
    names = [one["name"] for one in flown.browser.get("/api/signals").json()["signals"]][:SHOWN]
    flown.take_off()
    flown.start("follow_trajectory", "follow_trajectory", laps=100)
    checked = opened(flown, [], CHECKED)
    found: Figures = {}
    for what, shown, series in (("default page", names, DEFAULT), ("20 signals", [], MANY)):
        page = opened(flown, shown, series)
        time.sleep(size.of(*SETTLED))
        pids, begun, since = processes(up), page.bytes, time.monotonic()
        before = cpu_seconds(pids)["web"]
        time.sleep(size.of(*SECONDS))
        passed = time.monotonic() - since
        found[f"{what}: processor"] = (cpu_seconds(pids)["web"] - before) / passed
        found[f"{what}: kB/s"] = 1e-3 * (page.bytes - begun) / passed
        found["web: memory, MB"] = memory_mb(pids)["web"]
        page.close()
    frames = list(checked.messages)
    checked.close()
    flown.command("start_behavior", name="land")
    until(lambda: not flown.summary()["status"]["armed"], every=0.1)
    return found | compared(flown, frames)


def opened(flown: Pilot, shown: Sequence[str], series: Sequence[Sequence[str]]) -> Socket:
    cookie = "; ".join(f"{one.name}={one.value}" for one in flown.browser.cookies.jar)
    url = f"{flown.base.replace('http', 'ws')}/ws/telemetry"
    return Socket(url, cookie, asked_for(shown, series))


def asked_for(shown: Sequence[str], series: Sequence[Sequence[str]]) -> str:
    """Return a page's request for the newest values of some signals and every sample of others."""
    return json.dumps({"id": 1, "signals": shown, "series": [{"signals": one} for one in series]})


def compared(flown: Pilot, raw: Sequence[str | bytes]) -> Figures:
    """Compare what a page received with the run's log."""
    frames = [
        read(one, [], CHECKED) for one in raw if isinstance(one, bytes) and one[:2] == b"\1\0"
    ]
    parts = [(frame.origin, frame.series[0]) for frame in frames if frame.series]
    stamps = np.concatenate(
        [round(origin) * 10**9 + np.round(1e9 * p.time).astype(np.int64) for origin, p in parts]
    )
    mine = {name: np.concatenate([p.values[name] for _, p in parts]) for name in CHECKED[0]}
    told = sum(missing for _, part in parts for _, missing in part.holes)
    run = recorded(flown)
    state, reference = run.topics["state"], run.topics["reference"]
    logged = run.start_ns + np.round(1e9 * state.time).astype(np.int64)
    x = state.values("pose.pose.position.x")
    rows = [state.rows([f"pose.pose.position.{a}" for a in AXES]).astype(np.float64)]
    rows.append(reference.rows([f"position.{a}" for a in AXES]).astype(np.float64))
    error = np.linalg.norm(rows[0] - rows[1], axis=1)
    its: dict[str, npt.NDArray[Any]] = {
        "state.position.x": x,
        "error.distance": 1e3 * error,
        DERIVED: 2.0 * x,
    }
    is_tick = ~np.isnan(mine["state.position.x"])
    stamps, mine = stamps[is_tick], {name: one[is_tick] for name, one in mine.items()}
    inside = (logged >= stamps[0]) & (logged <= stamps[-1])
    _, here, there = np.intersect1d(stamps // 1000, logged // 1000, return_indices=True)
    differ = sum(
        int(np.count_nonzero(~np.isclose(mine[name][here], its[name][there], 1e-6, 1e-7)))
        for name in mine
    )
    expected = round((stamps[-1] - stamps[0]) / float(np.median(np.diff(stamps)))) + 1
    return {
        "ticks shown, %": 100.0 * len(here) / max(1, int(inside.sum())),
        "ticks of the log, %": 100.0 * int(inside.sum()) / expected,
        "ticks missing": float(expected - len(stamps)),
        "missing and not told": abs(expected - len(stamps) - told),
        "samples that differ": float(differ),
        "largest error, mm": float(mine["error.distance"].max()),
        "largest error of the log, mm": 1e3 * float(error[inside].max()),
    }


def recorded(flown: Pilot) -> Run:
    """Return the station's run, which has ended with the flight."""

    def ended() -> Any:
        runs = flown.browser.get("/api/runs").json()
        return runs and not flown.summary()["station"]["recording"] and runs[0]["id"]

    run_id = until(ended, every=0.2)
    answer = flown.browser.get(f"/api/runs/{run_id}/download", timeout=60.0)
    answer.raise_for_status()
    with tempfile.TemporaryDirectory(prefix="quadlab-benchmark-") as folder:
        file = Path(folder) / "run.mcap"
        file.write_bytes(answer.content)
        return read_run(file)
