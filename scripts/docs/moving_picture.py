"""docs/images/flight.webp: a flight on bearings on the replay page, in headless Chromium.

    python -m scripts.docs.moving_picture [LOG]

Without a log the experiment `bearings` is flown first, in simulated time. The page is the exported
one, which is drawn at each instant that is asked for: so the frames are the same on any machine.
"""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import quadlab
from benchmarks.harness import CHROMIUM
from extensions.replay.exported_page import export_page
from quadrotor.checkout import ROOT

WINDOW = 1000, 640
TIMES = (*np.arange(1.0, 10.0, 0.3), *np.arange(10.0, 78.5, 1.5))
"""Instants of the frames in s: take-off and hand-over slowly, the rest of the flight quickly."""
SHOWN = "t => Math.abs(Number(document.querySelector('main').dataset.shown) - t) < 0.2"
LASTS, LAST_LASTS = 110, 2000  # ms
QUALITY = 60


def frames(page_file: Path) -> list[Image.Image]:
    """Return pictures of an exported page at `TIMES`."""
    from playwright.sync_api import sync_playwright

    found = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(
            viewport={"width": WINDOW[0], "height": WINDOW[1]},
            color_scheme="light",
            reduced_motion="reduce",
        )
        page.set_default_timeout(60_000)
        page.goto(page_file.as_uri())
        page.wait_for_selector("main[data-shown]")
        duration = page.evaluate("globalThis.quadlabRun.description.duration")
        bar = page.locator("#line .bar").bounding_box()
        assert bar is not None
        for time in TIMES:
            x = bar["x"] + bar["width"] * time / duration
            page.mouse.click(x, bar["y"] + bar["height"] / 2)
            page.wait_for_function(SHOWN, arg=float(time))
            found.append(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))
        browser.close()
    return found


def main(log: Path | None) -> None:
    """Write the moving picture."""
    with tempfile.TemporaryDirectory() as folder:
        flown = log or quadlab.fly("bearings", seed=1, out=Path(folder)).path
        export_page(flown, Path(folder) / "page", lambda _: None)
        first, *others = frames(Path(folder) / "page" / "index.html")
    path = ROOT / "docs/images/flight.webp"
    durations = [*(LASTS for _ in others), LAST_LASTS]
    first.save(
        path,
        save_all=True,
        append_images=others,
        duration=durations,
        loop=0,
        quality=QUALITY,
        method=4,
    )
    print(f"{path}: {len(durations)} frames, {path.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
