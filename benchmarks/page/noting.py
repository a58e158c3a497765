"""The console in a browser that notes what it receives and draws, see live_page.js."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks.harness import CHROMIUM
from benchmarks.page.up_cost import Pilot

HOST, PORT, LINK_PORT = "127.0.0.1", 28095, 28465
WINDOW = {"width": 1440, "height": 900}
SPAN = 10
"""Seconds that charts of a given layout show: they are drawn whenever they move by half a pixel."""
NOTING = Path(__file__).with_name("live_page.js")


def launched(driver: Any, *flags: str) -> Any:
    """Return a browser without a graphics card."""
    flags = ("--no-sandbox", "--disable-gpu", *flags)
    return driver.chromium.launch(executable_path=CHROMIUM, args=flags)


@contextmanager
def console(
    browser: Any, flown: Pilot, layout: Sequence[Sequence[str]] = (), **look: Any
) -> Iterator[Any]:
    """Yield the console, with a default or given layout of the charts."""
    context = browser.new_context(**({"viewport": WINDOW} | look))
    context.add_cookies(flown.cookies())
    context.add_init_script(path=NOTING)
    if layout:
        charts = [{"signals": one, "scales": {}} for one in layout]
        kept = json.dumps({"name": "", "layout": {"window": SPAN, "charts": charts}})
        context.add_init_script(f"localStorage.setItem('charts.now', {json.dumps(kept)})")
    page = context.new_page()
    page.route("**/viser/**", lambda route: route.fulfill(body="", content_type="text/html"))
    page.goto(flown.base)
    page.locator("#behaviors button").first.wait_for()
    page.keyboard.press("Escape")  # the help of the first visit
    page.wait_for_function("() => window.source?.series[0]?.last !== undefined")
    yield page
    context.close()
