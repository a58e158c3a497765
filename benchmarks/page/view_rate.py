"""Frames a second of the 3D view where the processor draws it, next to an empty viser scene.

    python -m benchmarks view_rate

A simulated vehicle hovers, and Chromium shows the console at 1440 x 900 with WebGL in software. The
empty scene has the size of the console's view. Both are measured in turns in the same browser,
because the rate follows the load of the machine, and both are asked for as many frames as they can
draw. The console keeps to 20 Hz without a graphics card.
"""

from __future__ import annotations

import contextlib
import io
import math
import shutil
import statistics
import time
from typing import Any

from benchmarks.harness import CHROMIUM, Report, Row, Target
from benchmarks.page.laboratory import started
from benchmarks.page.late_ticks import DRAWING
from benchmarks.page.up_cost import pilot

PORT, LINK_PORT = 28120, 28490
ROUNDS, QUICK_ROUNDS = 3, 1
SETTLED = 25_000  # ms, until the automatic quality has found its level
WANTED = 15.0  # Hz
COUNT = """async () => {
  const inside = document.getElementById("scene")?.contentWindow ?? window;
  const start = performance.now();
  const drawn = () => inside.__viserTestpoints.rendererInfo.render.frame, before = drawn();
  for (;;) {
    inside.__viserMutable.requestRender();
    await new Promise((done) => inside.requestAnimationFrame(done));
    const spent = performance.now() - start;
    if (spent > 3000) return [drawn() - before, spent / 1e3];
  }
}"""


def run(quick: bool = False) -> Report:
    """Measure the console's view and the empty scene in turns."""
    import viser
    from playwright.sync_api import sync_playwright

    rates: dict[str, list[float]] = {"empty viser scene": [], "console": []}
    costs: dict[str, list[float]] = {name: [] for name in rates}
    began = time.monotonic()
    with (
        started(PORT, LINK_PORT, lockstep=True) as (_, lines),
        pilot(lines, PORT, began) as flown,
        sync_playwright() as driver,
    ):
        flown.take_off()
        with contextlib.redirect_stdout(io.StringIO()):
            empty = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        browser = driver.chromium.launch(executable_path=shutil.which(CHROMIUM), args=[*DRAWING])
        context = browser.new_context()
        context.add_cookies(
            [
                {"name": one.name, "value": one.value or "", "url": flown.base}
                for one in flown.browser.cookies.jar
            ]
        )
        page = context.new_page()
        devtools = browser.new_browser_cdp_session()

        def spent() -> float:
            """Return the processor time of all the browser's processes, s."""
            found = devtools.send("SystemInfo.getProcessInfo")
            return math.fsum(one["cpuTime"] for one in found["processInfo"])

        def count(name: str) -> None:
            before = spent()
            frames, seconds = page.evaluate(COUNT)
            rates[name].append(frames / seconds)
            costs[name].append(1e3 * (spent() - before) / max(frames, 1))

        for _ in range(QUICK_ROUNDS if quick else ROUNDS):
            page.set_viewport_size({"width": 1440, "height": 900})
            page.goto(flown.base)
            page.locator("#tick", has_text="%").wait_for()
            page.wait_for_timeout(SETTLED)
            count("console")
            quality = page.locator("#quality").inner_text()
            view: Any = page.locator("#scene").bounding_box()
            page.set_viewport_size({"width": round(view["width"]), "height": round(view["height"])})
            page.goto(f"http://127.0.0.1:{empty.get_port()}")
            page.wait_for_function("window.__viserTestpoints")
            page.wait_for_timeout(3000)
            count("empty viser scene")
        browser.close()
        empty.stop()
    shares = [a / b for a, b in zip(rates["console"], rates["empty viser scene"], strict=True)]
    console_rate = statistics.median(rates["console"])
    return Report(
        "view_rate",
        "Rate of the 3D view without a graphics card, Hz",
        [
            "1440 x 900, hovering; medians, both in turns",
            "ms a frame: processor time of the whole browser, in which the console's charts count",
            f"the view says: {quality or 'nothing'}",
        ],
        rows=[
            Row(name, {"Hz": statistics.median(of), "ms a frame": statistics.median(costs[name])})
            for name, of in rates.items()
        ],
        targets=[Target("console, Hz", console_rate, WANTED, at_most=False)],
        notes=[f"console / empty scene: {statistics.median(shares):.2f}"],
    )
