"""Measure how soon an open page shows that the vehicle has fallen silent, and that it is back.

    python -m benchmarks page_notice

The whole `quadlab up`, with the vehicle's comms process stopped and continued (SIGSTOP, SIGCONT):
to all others the radio is out of reach at once. Timed until the frame after the change is drawn in
a headless Chromium on the same machine; its 3D view is an empty document, because without a
graphics card drawing it occupies both cores and would be what is measured.
"""

from __future__ import annotations

import os
import random
import re
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from benchmarks.harness import CHROMIUM, Report, Row, Size, Target
from benchmarks.page.laboratory import processes, started
from quadrotor.errors import QuadlabError

PORT, LINK_PORT = 28081, 28448
COUNT = 40, 5, 1  # of each size
SETTLED = 5.0, 5.0, 0.5  # s, of each size
SILENT, HEARD = 1.0, 3.0  # s
PATIENCE = 90.0  # s
LIMIT = 300.0  # ms
WATCH = """() => {
  const chips = document.getElementById("flags"), link = document.getElementById("link");
  const notice = document.getElementById("contact");  // takes the chip's place after a while
  const told = () => (/no telemetry/.test(chips.textContent) || !notice.hidden)
    && link.matches(".warn, .stale");
  let last = told();
  window.noticed = [];
  const all = { subtree: true, childList: true, characterData: true, attributes: true };
  new MutationObserver(() => {
    if (told() === last) return;
    last = !last;
    const now = last;
    requestAnimationFrame(() => setTimeout(() => window.noticed.push([now, Date.now()])));
  }).observe(document.body, all);
}"""

SAID = "window.noticed.splice(0)"


def run(size: Size = Size.FULL) -> Report:
    """Run the benchmark. Raises QuadlabError when the laboratory or the page does not start."""
    from playwright.sync_api import sync_playwright

    count = size.of(*COUNT)
    drawn = random.Random(10)
    report = Report(
        "page_notice",
        "The page when the link is lost",
        [
            f"{count} times {SILENT:g} s without the vehicle's comms; from the signal until chip "
            "and bar both say so and the frame is drawn; the vehicle stands on the ground",
            "headless Chromium on the same machine, 1440 x 900, the 3D view empty",
        ],
    )
    lost, back, unasked = [], [], 0
    with laboratory() as (url, comms), sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.route("**/viser/**", lambda route: route.fulfill(body="", content_type="text/html"))
        page.goto(url)
        page.wait_for_selector("#behaviors button")
        page.evaluate(WATCH)
        _until(lambda: "no telemetry" not in (page.text_content("#flags") or ""))
        page.wait_for_timeout(1e3 * size.of(*SETTLED))
        page.evaluate(SAID)
        for _ in range(count):
            page.wait_for_timeout(1e3 * (HEARD + drawn.uniform(0.0, 0.2)))
            unasked += len(page.evaluate(SAID))
            lost.append(noticed(page, comms, signal.SIGSTOP, True))
            page.wait_for_timeout(1e3 * SILENT)
            unasked += len(page.evaluate(SAID))
            back.append(noticed(page, comms, signal.SIGCONT, False))
        browser.close()
    for name, times in (("says that it is silent after", lost), ("that it is back after", back)):
        low, middle, high = np.percentile(times, [0, 50, 100])
        report.rows.append(Row(name, {"least, ms": low, "median, ms": middle, "longest, ms": high}))
    report.notes.append(f"changes while nothing was done: {unasked}, as when the machine stalls")
    report.targets = [Target("page says so after, longest, ms", max(lost), LIMIT)]
    return report


def noticed(page: Any, comms: int, what: signal.Signals, wanted: bool) -> float:
    """Return the ms from the signal until the page shows it."""
    begin = time.time()
    os.kill(comms, what)
    return float(_until(lambda: _when(page, wanted)) - 1e3 * begin)


def _when(page: Any, wanted: bool) -> float:
    """Return the ms since the epoch at which the page began to show it; 0 when it has not."""
    return next((float(at) for says, at in page.evaluate(SAID) if says is wanted), 0.0)


@contextmanager
def laboratory() -> Iterator[tuple[str, int]]:
    """Yield a signed-in address of the page, and the process of the vehicle's comms."""
    with started(PORT, LINK_PORT) as (up, lines):
        try:
            address = _until(lambda: re.findall(r"http://\S+token=\S+", "".join(lines)))[-1]
            yield address, _until(lambda: _comms(up))[0]
        finally:
            for comms in _comms(up):
                os.kill(comms, signal.SIGCONT)


def _comms(parent: int) -> list[int]:
    """Return the descendants of `parent` that run the vehicle's comms."""
    return [pid for pid, name in processes(parent).items() if name == "vehicle.comms.process"]


def _until(look: Callable[[], Any]) -> Any:
    end = time.monotonic() + PATIENCE
    while not (found := look()):
        if time.monotonic() > end:
            raise QuadlabError(f"laboratory and page: waited {PATIENCE:.0f} s in vain")
        time.sleep(0.1)
    return found
