"""A phone that shows the console behind links of several rates. Part of `live_page`."""

from __future__ import annotations

import math
import statistics
from typing import Any

import numpy as np

from benchmarks.harness import Size
from benchmarks.page.noting import HOST, PORT, console, launched
from benchmarks.page.slow_link import slow_link
from benchmarks.page.up_cost import SETTLED, Figures, Pilot

SECONDS = 20.0, 10.0, 1.0  # of each size
PRESSES = 20, 10, 1
RATES = {"1 Mbit/s": 125e3, "10 MB/s": 10e6, "0.1 Mbit/s": 12.5e3}  # bytes a second
WINDOW = {"width": 390, "height": 844}


def phone(driver: Any, flown: Pilot, size: Size) -> Figures:
    """Measure a phone behind links of several rates."""
    look: dict[str, Any] = {
        "viewport": WINDOW,
        "has_touch": True,
        "is_mobile": True,
        "device_scale_factor": 2,
    }
    figures: Figures = {}
    with (
        slow_link(PORT, max(RATES.values())) as link,
        # The page's address stays, as quadlab refuses requests by another.
        launched(driver, f"--host-resolver-rules=MAP {HOST}:{PORT} {HOST}:{link.port}") as browser,
        console(browser, flown, **look) as page,
    ):
        for name, rate in size.some(RATES.items()):
            link.change(rate)
            page.wait_for_timeout(1e3 * size.of(*SETTLED))
            before = link.received
            found = lived(page, size.of(*SECONDS))
            found["kB/s"] = 1e-3 * (link.received - before) / size.of(*SECONDS)
            presses = pressed(page, size.of(*PRESSES))
            found["emergency answered, median, ms"] = statistics.median(presses)
            found["emergency answered, longest, ms"] = max(presses)
            figures |= {f"phone, {name}: {what}": value for what, value in found.items()}
    return figures


def lived(page: Any, seconds: float) -> Figures:
    """Return how the page's frames came for so long."""
    page.evaluate("noted.comes.splice(0)")
    page.wait_for_timeout(1e3 * seconds)
    ended = 1e-3 * page.evaluate("Date.now()")
    came = np.array(page.evaluate("noted.comes")).reshape(-1, 3)
    return {
        "longest without a frame, s": max(np.diff([ended - seconds, *came[:, 0], ended])),
        "age of a frame, median, s": float(np.median(came[:, 1])) if len(came) else math.inf,
        "age of a frame, longest, s": float(came[:, 1].max(initial=0.0)),
        "samples that became one": float(came[:, 2].max(initial=0.0)),
    }


def pressed(page: Any, count: int) -> list[float]:
    """Press the emergency; return the ms until the page shows the vehicle's answers.

    The first ones land the vehicle, which refuses those after its landing.
    """
    page.evaluate("noted.presses.splice(0)")
    for k in range(1, count + 1):
        page.tap("#emergency-land")
        page.wait_for_function(f"() => noted.presses.length === {k}")
        page.wait_for_timeout(500)
    return [1e3 * one for one in page.evaluate("noted.presses")]
