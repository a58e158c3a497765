"""A large campaign by two workers, while the page looks at it.

    python -m benchmarks campaign_size --count 100000

The flights are those of `closed_loop`: the 8 of 27 s with sensors and filter. The rate is that of
wall time from the first rows on, and so is that of `fly_batch` alone, before and after. The page's
answers come from its routes, in this process, without a network.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import httpx
import psutil
from fastapi import FastAPI

from benchmarks.harness import Report, Row, Size, Target
from extensions.batches.batch import Scenario, fly_batch
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.routes import FOLDER, add_campaigns
from extensions.campaigns.tests.test_page import Client

PLAN = """experiment = "closed_loop"
seeds = {seeds}
[factors]
"control.position.kp_xy" = [3.0, 3.5, 4.0, 4.5, 5.0]
"simulator.payload" = [0.0, 0.1, 0.2, 0.3]
"""
CELLS = 20
NAME = "large"
WORKERS = 2
DURATION, HOVER = 27.0, 8.0
"""Durations of the compiled flight and of its hover, s, as the options have them."""
ALONE = 1000
"""Flights of `fly_batch` alone, before and after."""
LOOK = 1.0
"""Seconds between two looks at the page."""


@dataclass
class Watched:
    """The observations of a campaign while it ran.

    Attributes:
        rows: moment (s) and number of rows. answers: s of wall time of each answer of the page.
        memory: largest MB of all its processes.
    """

    rows: list[tuple[float, int]] = field(default_factory=list)
    answers: list[float] = field(default_factory=list)
    memory: float = 0.0

    @property
    def rate(self) -> float:
        """Return flights a second from the first rows seen on."""
        (began, first), (ended, last) = self.rows[0], self.rows[-1]
        return (last - first) / max(1e-9, ended - began)


def run(size: Size = Size.FULL, count: int | None = None) -> Report:
    """Fly a campaign of `count` flights, and look at it."""
    seeds = max(1, (count or size.of(100_000, 4_000, 20)) // CELLS)
    alone = size.of(ALONE, ALONE // 5, 2)
    with TemporaryDirectory(prefix="quadlab-size-") as made:
        place = Path(made)
        plan = place / "plan.toml"
        plan.write_text(PLAN.format(seeds=seeds))
        fly_batch([Scenario()], 1.0, threads=1)  # loads the machine code
        before = _alone(alone)
        seen = _watched(plan, place)
        rates = [before, _alone(alone)]
        table = CampaignFolder(place / FOLDER / NAME).table(figures_only=True)
    if table.num_rows != CELLS * seeds:
        raise RuntimeError(f"{table.num_rows} of {CELLS * seeds} rows")
    worst = 1e3 * max(seen.answers)
    usual = 1e3 * statistics.median(seen.answers)
    report = Report(
        "campaign_size",
        "A large campaign",
        [
            f"{CELLS * seeds} flights of closed_loop, 27 s with sensors and filter, "
            f"{WORKERS} workers; fly_batch alone: {alone} flights in {WORKERS} threads, before and "
            "after",
            f"page: list, and the campaign with all of its figures, every {LOOK:g} s",
        ],
    )
    report.rows = [
        Row("fly_batch alone", {"flights a second": statistics.mean(rates)}),
        Row(
            "campaign",
            {
                "flights a second": seen.rate,
                "memory, MB": seen.memory,
                "answers": len(seen.answers),
                "median answer, ms": usual,
                "worst answer, ms": worst,
            },
        ),
    ]
    report.targets = [
        Target("campaign over fly_batch", seen.rate / statistics.mean(rates), 0.9, at_most=False),
        Target("memory of all processes, MB", seen.memory, 600.0),
        Target("median answer of the page, ms", usual, 200.0),
    ]
    report.notes.append(f"load of the machine at the end {os.getloadavg()[0]:.2f}")
    return report


def _alone(flights: int) -> float:
    """Return the flights a second of `fly_batch`."""
    began = time.perf_counter()
    fly_batch([Scenario(seed=k) for k in range(flights)], DURATION, hover=HOVER, threads=WORKERS)
    return flights / (time.perf_counter() - began)


def _watched(plan: Path, place: Path) -> Watched:
    """Fly a plan by the command, and look at it as the page does until it ends."""
    app, seen, out = FastAPI(), Watched(), place / FOLDER / NAME
    shared = SimpleNamespace(catalogue=SimpleNamespace(folder=place / "runs"), closing=ExitStack())
    add_campaigns(app, shared)  # type: ignore[arg-type]
    client = Client(app)
    words = ["campaign", "run", str(plan), "--out", str(out), "--workers", str(WORKERS)]
    command = [sys.executable, "-m", "quadlab", *words]

    def look() -> None:
        if not seen.rows:
            client.get(f"/api/campaigns/{NAME}")  # the first one loads libraries
        seen.rows.append((time.perf_counter(), CampaignFolder(out).count()))
        seen.answers += [
            _timed(lambda: client.get("/api/campaigns")),
            _timed(lambda: client.get(f"/api/campaigns/{NAME}")),
        ]

    with shared.closing, subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        while process.poll() is None:
            seen.memory = max(seen.memory, _memory(process.pid))
            if (out / "campaign.json").exists() and CampaignFolder(out).count():
                look()
            with suppress(subprocess.TimeoutExpired):
                process.wait(LOOK)
        if process.returncode:
            raise RuntimeError(f"the campaign ended with status {process.returncode}")
        look()
    return seen


def _timed(ask: Callable[[], httpx.Response]) -> float:
    began = time.perf_counter()
    ask().raise_for_status()
    return time.perf_counter() - began


def _memory(pid: int) -> float:
    """Return the MB of a process and its children, each with its share of what they share."""
    try:
        parent = psutil.Process(pid)
        every = [parent, *parent.children(recursive=True)]
        return float(sum(one.memory_full_info().pss for one in every)) / 1e6
    except psutil.Error:  # one has ended meanwhile
        return 0.0
