"""The share of the flight loop's ticks that are late, with and without a page.

    python -m benchmarks late_ticks [--against TREE]

A simulated vehicle hovers and then flies an 8: with no page open, with a client that has a page's
three websockets, and with the page in a browser that draws it in software on the same processors.
With another checkout, which needs its own environment, both run in turns.

The share is the one that the page's bar shows: periods whose sample never arrived, or arrived a
period late. It is a mean over the time, because one second in ten may have all of them.
"""

from __future__ import annotations

import shutil
import statistics
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path

from benchmarks.harness import CHROMIUM, Report, Row, Size, Target
from benchmarks.page.laboratory import started
from benchmarks.page.up_cost import SETTLED, Figures, Pilot, page, pilot
from quadrotor.checkout import ROOT

PORT, LINK_PORT = 28100, 28470
ROUNDS, SECONDS = (3, 1, 1), (20.0, 8.0, 0.5)  # of each size
LOOK = 0.5  # s
LIMIT = 1.0
"""Limit in %: more is amber on the page's bar."""
DRAWING = ("--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader")
"""Options of Chromium as on a computer without a graphics card: an emulated one draws WebGL alone.

With `--use-angle=swiftshader` it would also put the whole page together, which takes several times
as long as the 3D view.
"""


def run(size: Size = Size.FULL, against: str | None = None) -> Report:
    """Measure this checkout, in turns with the one at `against` if given."""
    rounds, seconds = size.of(*ROUNDS), size.of(*SECONDS)
    trees = {"this checkout": ROOT} | ({"the other": Path(against)} if against else {})
    found: dict[str, list[Figures]] = {name: [] for name in trees}
    for _ in range(rounds):
        for name, tree in trees.items():
            began = time.monotonic()
            with (
                started(PORT, LINK_PORT, tree=tree, lockstep=True) as (_, lines),
                pilot(lines, PORT, began) as flown,
            ):
                found[name].append(measure(flown, size))
    report = Report(
        "late_ticks",
        "Late ticks of the flight loop, %",
        [
            f"one simulated vehicle in lockstep; medians of {rounds} starts, {seconds:g} s each",
            "client: with the page's three websockets; browser: draws the page in software",
        ],
    )
    for key in found["this checkout"][0]:
        medians = {name: statistics.median(one[key] for one in of) for name, of in found.items()}
        report.rows.append(Row(key, {**medians}))
        if "browser" not in key:
            report.targets.append(Target(f"{key}, %", medians["this checkout"], LIMIT))
        elif "the other" in medians:
            limit = medians["the other"] + LIMIT
            report.targets.append(Target(f"{key}, %", medians["this checkout"], limit))
    return report


def measure(flown: Pilot, size: Size) -> Figures:
    """Return the percentage of late ticks for each flight and page."""
    flown.take_off()
    figures: Figures = {}
    for flight in size.some(("hover", "8")):
        if flight == "8":
            flown.start("follow_trajectory", "follow_trajectory", laps=100)
        pages: dict[str, AbstractContextManager[None]] = {
            "no page": nullcontext(),
            "client": page(flown),
        }
        if shutil.which(CHROMIUM):
            pages["browser"] = drawn(flown)
        for name, shown in pages.items():
            with shown:
                time.sleep(size.of(*SETTLED))
                figures[f"{flight}, {name}"] = late(flown, size.of(*SECONDS))
    return figures


def late(flown: Pilot, seconds: float) -> float:
    """Return the mean percentage of late ticks over this many seconds."""
    shares, end = [], time.monotonic() + seconds
    while time.monotonic() < end:
        time.sleep(LOOK)
        shares.append(100.0 * flown.summary()["status"]["missed_share"])
    return statistics.fmean(shares)


@contextmanager
def drawn(flown: Pilot) -> Iterator[None]:
    """Show the console in a browser."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which(CHROMIUM), args=[*DRAWING])
        context = browser.new_context(viewport={"width": 1440, "height": 900})
        context.add_cookies(flown.cookies())
        console = context.new_page()
        console.goto(flown.base)
        console.locator("#tick", has_text="%").wait_for()
        yield
        browser.close()
