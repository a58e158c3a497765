"""Measure the open page in a browser beside a flight: its frames, its delay, and what it survives.

    python -m benchmarks live_page

One simulated vehicle flies eights in real time, as stamps are then of the computer's own clock.
Chromium shows the console with an empty 3D view, which without a graphics card would be what is
measured:

- frames: 20 signals of 500 Hz in four charts, in turns with a plain uPlot page of as many;
- from a tick on board to the frame that shows it, in the default charts;
- five clients with a page's three websockets, which give way to the flight, as browsers on other
  computers do;
- the page's process stopped for minutes, as by a browser or a computer that sleeps;
- a phone behind links of several rates.
"""

from __future__ import annotations

import os
import signal
import statistics
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.page.clients import clients
from benchmarks.page.laboratory import cpu_seconds, processes, started
from benchmarks.page.live_signals import MANY
from benchmarks.page.noting import LINK_PORT, PORT, SPAN, WINDOW, console, launched
from benchmarks.page.phone import phone
from benchmarks.page.up_cost import PATIENCE, Figures, Pilot, pilot
from web.uplot import read_uplot

SETTLED = 5.0, 3.0, 0.3  # s, of each size
ROUNDS, SECONDS = (3, 1, 1), (20.0, 10.0, 0.5)
HIDDEN = 300.0, 60.0, 0.5
PAGES, TURNS, TURN = 5, (6, 5, 1), (10.0, 5.0, 0.5)
"""Number of clients; turns without and with them, of each size, and the seconds of each."""
LAYOUT = [MANY[0][:6], MANY[0][6:], MANY[1], MANY[2]]
PLAIN = Path(__file__).with_name("plain_uplot.html")
LONG = 50.0  # ms
TIMES = """(() => {
  const { times, start, end } = source.series[0];
  return [...times.slice(start, end)].map((time) => source.origin + time);
})()"""
LIMITS = {
    "20 signals: frames above 50 ms": 0.0,
    "tick to pixel: median, ms": 80.0,
    "tick to pixel: 99 %, ms": 150.0,
    "each of five pages: cores of the web process": 0.10,
    "shown again: s until all is drawn": 1.0,
    "shown again: longest step, s": 0.3,
    "phone, 1 Mbit/s: emergency answered, longest, ms": 250.0,
}


def run(size: Size = Size.FULL) -> Report:
    """Measure with one vehicle in real time."""
    from playwright.sync_api import sync_playwright

    began = time.monotonic()
    with (
        started(PORT, LINK_PORT, "--set", "simulator.battery_capacity=20") as (up, lines),
        pilot(lines, PORT, began) as flown,
        sync_playwright() as driver,
    ):
        browser = launched(driver)
        flown.take_off()
        flown.start("follow_trajectory", "follow_trajectory", laps=1000)
        figures = frames(browser, flown, size) | room(flown, up, size)
        figures |= hidden(browser, flown, size)
        figures |= phone(driver, flown, size)
        browser.close()
    report = Report(
        "live_page",
        "The open page beside a flight",
        [
            "one simulated vehicle flies eights in real time; headless Chromium with an empty 3D "
            f"view on the same machine; load of the computer {os.getloadavg()[0]:.1f}",
            "frames: long animation frames of the browser; tick to pixel: every tick, from its "
            "stamp to the end of the frame that shows it",
        ],
    )
    report.rows += [Row(name, {"value": value}) for name, value in figures.items()]
    report.targets += [Target(name, figures[name], limit) for name, limit in LIMITS.items()]
    return report


def frames(browser: Any, flown: Pilot, size: Size) -> Figures:
    """Measure frames and delay of the console, in turns with a plain page."""
    found: dict[str, list[Figures]] = {"20 signals": [], "plain uPlot page": []}
    delays, behind = list[float](), list[float]()
    for _ in range(size.of(*ROUNDS)):
        with console(browser, flown, LAYOUT) as page:
            boxes = page.locator("#chart-0 canvas").bounding_box()
            found["20 signals"].append(drawn(page, size))
        with console(browser, flown) as page:
            drawn(page, size)
            page.wait_for_function("() => noted.delays.length", timeout=1e3 * PATIENCE)
            delays += page.evaluate("noted.delays")
            behind.append(min(page.evaluate("noted.comes.map(([, late]) => late)")))
        context = browser.new_context(viewport=WINDOW)
        page = context.new_page()
        page.goto(PLAIN.as_uri())
        page.add_script_tag(content=read_uplot("uPlot.iife.js").decode())
        shape = {"counts": [*map(len, LAYOUT)], "rate": 500, "seconds": SPAN}
        page.evaluate("draw", shape | {key: round(boxes[key]) for key in ("width", "height")})
        found["plain uPlot page"].append(drawn(page, size))
        context.close()
    figures = {
        f"{name}: {what}": (max if "longest" in what else statistics.median)(
            [one[what] for one in of]
        )
        for name, of in found.items()
        for what in of[0]
    }
    middle, high = (1e3 * float(x) for x in np.percentile(delays, [50, 99]))
    return figures | {
        "tick to pixel: median, ms": middle,
        "tick to pixel: 99 %, ms": high,
        "of these, by which the vehicle's clock is behind, ms": 1e3 * statistics.median(behind),
    }


def drawn(page: Any, size: Size) -> Figures:
    """Measure the frames of a page that draws."""
    devtools = page.context.new_cdp_session(page)
    devtools.send("Performance.enable", {"timeDomain": "threadTicks"})

    def spent() -> float:
        found = devtools.send("Performance.getMetrics")["metrics"]
        return float(next(one["value"] for one in found if one["name"] == "TaskDuration"))

    page.wait_for_timeout(1e3 * size.of(*SETTLED))
    page.evaluate("window.begin?.()")
    page.evaluate("Object.values(noted).forEach((list) => list.splice(0))")
    before, since = spent(), time.monotonic()
    page.wait_for_timeout(1e3 * size.of(*SECONDS))
    passed = time.monotonic() - since
    busy = (spent() - before) / passed
    noted = page.evaluate("({ frames: noted.frames, draws: noted.draws.length })")
    long = [duration for _, duration in noted["frames"] if duration > LONG]
    return {
        "frames above 50 ms": float(len(long)),
        "longest frame, ms (0: none above 50)": max(long, default=0.0),
        "drawings a second": noted["draws"] / passed,
        "main thread, cores": busy,
    }


def room(flown: Pilot, up: int, size: Size) -> Figures:
    """Measure the flight and the web process without and with clients, in turns."""
    found: dict[int, list[Figures]] = {0: [], PAGES: []}
    for _ in range(size.of(*TURNS)):
        for count, of in found.items():
            with clients(flown, count) if count else nullcontext():
                time.sleep(size.of(*SETTLED))
                of.append(watched(flown, up, size.of(*TURN)))
    alone, full = (
        {name: statistics.median(one[name] for one in of) for name in of[0]}
        for of in found.values()
    )
    spent = (full.pop("cores") - alone.pop("cores")) / PAGES
    return {
        "each of five pages: cores of the web process": spent,
        **{f"without a page: {name}": value for name, value in alone.items()},
        **{f"five pages: {name}": value for name, value in full.items()},
    }


def watched(flown: Pilot, up: int, seconds: float) -> Figures:
    """Return what the flight and the web process did for so long."""
    pids = processes(up)
    before, since, missed, late, queued = cpu_seconds(pids), time.monotonic(), [], [], [0]
    while time.monotonic() - since < seconds:
        time.sleep(0.2)
        status = flown.summary()["status"]
        missed.append(100.0 * status["missed_share"])
        late.append(1e3 * status["lateness_p99"])
        queued.append(unsent())
    passed = time.monotonic() - since
    return {
        "cores": (cpu_seconds(pids)["web"] - before["web"]) / passed,
        "ticks missed or late, %": statistics.fmean(missed),
        "99 % of the loop's lateness, ms": statistics.median(late),
        "most bytes unsent in all sockets": float(max(queued)),
    }


def unsent() -> int:
    """Return the bytes that wait in the sockets of the page's server."""
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return sum(int(row[4].split(":")[0], 16) for row in rows if row[1].endswith(f":{PORT:04X}"))


def stopped(browser: Any, what: signal.Signals) -> None:
    """Stop or continue the processes that run the browser's pages."""
    devtools = browser.new_browser_cdp_session()
    for one in devtools.send("SystemInfo.getProcessInfo")["processInfo"]:
        if one["type"] == "renderer":
            os.kill(one["id"], what)


def hidden(browser: Any, flown: Pilot, size: Size) -> Figures:
    """Stop the page for long, and measure until it has drawn what it missed."""
    newest = "source.origin + source.series[0].last"
    with console(browser, flown) as page:
        page.wait_for_timeout(1e3 * size.of(*SETTLED))
        since = page.evaluate(newest)
        behind = statistics.median(late for _, late, _ in page.evaluate("noted.comes"))
        stopped(browser, signal.SIGSTOP)
        try:
            time.sleep(size.of(*HIDDEN))
        finally:
            shown = time.time()
            stopped(browser, signal.SIGCONT)
        full = f"noted.draws.find(([, newest]) => newest >= {shown - behind})"
        page.wait_for_function(f"() => {full}", timeout=1e3 * PATIENCE)
        took = page.evaluate(full)[0] - shown
        times = page.evaluate(TIMES)
        came = page.evaluate("noted.comes.map(([at]) => at)")
        holes = page.evaluate("source.series[0].holes.map((one) => [one.t, one.count])")
    inside = [t for t in times if since <= t <= shown - behind]
    return {
        "hidden: s without a frame": max(np.diff(came)),
        "shown again: s until all is drawn": took,
        "shown again: longest step, s": max(np.diff([since, *inside])),
        "shown again: ticks told to be missing": float(sum(count for _, count in holes)),
    }
