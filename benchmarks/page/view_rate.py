"""The console in a browser without a graphics card: the time until it can be used, its weight, and
frames a second of its 3D view next to an empty viser scene.

    python -m benchmarks view_rate

First the console is opened with an empty cache, then again and again with a full one, while the
simulated vehicle waits to be armed. It can be used when it shows the vehicle's name and the age of
the telemetry, and its first button is enabled.

Then the vehicle hovers, and Chromium shows the console at 1440 x 900 with WebGL in software. The
empty scene has the size of the console's view. Both are measured in turns in the same browser,
because the rate follows the load of the machine, and both are asked for as many frames as they can
draw. The console keeps to 20 Hz without a graphics card.
"""

from __future__ import annotations

import contextlib
import io
import math
import os
import shutil
import statistics
import time
from typing import Any

from benchmarks.harness import CHROMIUM, Report, Row, Size, Target
from benchmarks.page.laboratory import started, until
from benchmarks.page.late_ticks import DRAWING
from benchmarks.page.up_cost import PATIENCE, pilot

PORT, LINK_PORT = 28120, 28490
ROUNDS = 3, 1, 1  # of each size
SETTLED = 25_000, 25_000, 500  # ms of each size, until the automatic quality has found its level
WANTED = 15.0  # Hz
OPENED = 9, 3, 1  # times with a full cache
WINDOW = {"width": 1440, "height": 900}
SLOWEST = 2.0  # s
HEAVIEST = 1.2  # MB
USABLE = """(() => {
  if (window !== top) return;
  const is = () => document.getElementById("vehicle")?.textContent.trim() !== "…"
    && /\\d/.test(document.getElementById("link")?.textContent)
    && !document.getElementById("plain-emergency") && document.querySelector("#primary :enabled");
  const timer = setInterval(() => {
    if (!is()) return;
    window.usable = performance.now() / 1e3;
    clearInterval(timer);
  }, 5);
})()"""
"""Script of the page, which sets `usable`, s since the navigation began."""
IS_DRAWN = """() => {
  const inside = document.getElementById("scene")?.contentWindow ?? window;
  return inside.__viserTestpoints?.rendererInfo && inside.__viserMutable?.requestRender;
}"""
"""A script that tells whether the view draws, which a busy computer begins late."""
COUNT = """async (duration) => {
  const inside = document.getElementById("scene")?.contentWindow ?? window;
  const start = performance.now();
  const drawn = () => inside.__viserTestpoints.rendererInfo.render.frame, before = drawn();
  for (;;) {
    inside.__viserMutable.requestRender();
    await new Promise((done) => inside.requestAnimationFrame(done));
    const spent = performance.now() - start;
    if (spent > duration) return [drawn() - before, spent / 1e3];
  }
}"""


def run(size: Size = Size.FULL) -> list[Report]:
    """Open the console, then measure its view and the empty scene in turns."""
    from playwright.sync_api import sync_playwright

    began = time.monotonic()
    with (
        started(PORT, LINK_PORT, lockstep=True) as (_, lines),
        pilot(lines, PORT, began) as flown,
        sync_playwright() as driver,
    ):
        browser = driver.chromium.launch(executable_path=shutil.which(CHROMIUM), args=[*DRAWING])
        context = browser.new_context(viewport={"width": 1440, "height": 900})
        context.add_init_script(USABLE)
        context.add_cookies(flown.cookies())
        page = context.new_page()
        until(lambda: (flown.summary().get("preflight") or {}).get("ready"), PATIENCE)
        reports = [opened(page, flown.base, size.of(*OPENED))]
        flown.take_off()
        reports.append(drawn(browser, page, flown.base, size))
        browser.close()
    return reports


def opened(page: Any, base: str, times: int) -> Report:
    """Measure the time until the console can be used, and what its first load weighs."""
    answered: list[Any] = []
    page.on("requestfinished", lambda one: answered.append(one))  # noqa: PLW0108 -- it sets attributes

    def seconds() -> float:
        page.goto(base)
        until(lambda: page.evaluate("window.usable"))
        usable: float = page.evaluate("window.usable")
        return usable

    first = seconds()
    page.wait_for_load_state("networkidle")
    weights = {one.url: one.sizes()["responseBodySize"] for one in answered}
    client = sum(weight for url, weight in weights.items() if "/viser/" in url) / 1e6
    rest = math.fsum(weights.values()) / 1e6 - client
    again = sorted(seconds() for _ in range(times))
    return Report(
        "page_start",
        "Opening the console without a graphics card",
        [
            f"from the navigation until it can be used; {times} times with a full cache",
            f"one vehicle on the ground; load of the computer {os.getloadavg()[0]:.1f}",
            "MB: bodies of all answers as sent; the client of the 3D view comes after the rest",
        ],
        rows=[
            Row("empty cache", {"s": first, "MB": rest, "MB of the 3D view's client": client}),
            Row("full cache, fastest", {"s": again[0]}),
            Row("full cache, median", {"s": statistics.median(again)}),
        ],
        targets=[
            Target("full cache, median, s", statistics.median(again), SLOWEST),
            Target("first load beside the 3D view's client, MB", rest, HEAVIEST),
        ],
    )


def drawn(browser: Any, page: Any, base: str, size: Size) -> Report:
    """Measure the rates of the console's view and of the empty scene."""
    import viser

    with contextlib.redirect_stdout(io.StringIO()):
        empty = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    rates: dict[str, list[float]] = {"empty viser scene": [], "console": []}
    costs: dict[str, list[float]] = {name: [] for name in rates}
    devtools = browser.new_browser_cdp_session()

    def spent() -> float:
        """Return the processor time of all the browser's processes, s."""
        found = devtools.send("SystemInfo.getProcessInfo")
        return math.fsum(one["cpuTime"] for one in found["processInfo"])

    def count(name: str) -> None:
        before, since = spent(), time.monotonic()
        frames, seconds = page.evaluate(COUNT, size.of(3000, 3000, 500))
        cores = (spent() - before) / (time.monotonic() - since)  # a busy page answers late
        rates[name].append(frames / seconds)
        costs[name].append(1e3 * cores * seconds / max(frames, 1))

    for _ in range(size.of(*ROUNDS)):
        page.set_viewport_size(WINDOW)
        page.goto(base)
        page.locator("#tick", has_text="%").wait_for()
        page.wait_for_function(IS_DRAWN, timeout=1e3 * PATIENCE)
        page.wait_for_timeout(size.of(*SETTLED))
        count("console")
        quality = page.locator("#quality").inner_text()
        view: Any = page.locator("#scene").bounding_box()
        page.set_viewport_size({"width": round(view["width"]), "height": round(view["height"])})
        page.goto(f"http://127.0.0.1:{empty.get_port()}")
        page.wait_for_function(IS_DRAWN, timeout=1e3 * PATIENCE)
        page.wait_for_timeout(size.of(3000, 3000, 500))
        count("empty viser scene")
    with contextlib.redirect_stdout(io.StringIO()):
        empty.stop()
    shares = [a / b for a, b in zip(rates["console"], rates["empty viser scene"], strict=True)]
    return Report(
        "view_rate",
        "Rate of the 3D view without a graphics card, Hz",
        [
            "1440 x 900, hovering; medians, both in turns",
            "ms a frame: processor time of the whole browser, in which the console's charts count",
            f"the view says: {quality or 'nothing'}; load of the computer {os.getloadavg()[0]:.1f}",
        ],
        rows=[
            Row(name, {"Hz": statistics.median(of), "ms a frame": statistics.median(costs[name])})
            for name, of in rates.items()
        ],
        targets=[Target("console, Hz", statistics.median(rates["console"]), WANTED, at_most=False)],
        notes=[f"console / empty scene: {statistics.median(shares):.2f}"],
    )
