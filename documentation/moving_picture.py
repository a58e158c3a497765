"""docs/images/flight.webp and page.png, filmed from a running `quadlab up` in headless Chromium.

    python -m documentation.moving_picture [FOLDER]

The vehicle takes off on the tracker, hands over to bearings, and the noise of the bearings falls,
so that the cones of three sigma shrink. A browser without a graphics card draws few frames a
second: simulated time does not wait for it, but each frame is shown as long as it lasted.
"""

from __future__ import annotations

import io
import itertools
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from PIL import Image

from benchmarks.harness import CHROMIUM
from benchmarks.page.laboratory import started, until
from quadrotor.checkout import ROOT

PORT, LINK_PORT = 28085, 28452
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
WINDOW = {"width": 1040, "height": 640}
WIDTH = 832
"""Width of the moving picture, in pixels."""
SIGMA = 1.2, 0.9, 0.6, 0.3
"""Noise of the bearings after the hand-over, in degrees; the default is 1.5."""
FASTER = 2.5
"""Speed of the moving picture."""
QUALITY = 55
PATIENCE = 120.0  # s
FAILED = "build/moving_picture_failed.png"


class Film:
    """Frames of a page with their times, taken while something is waited for."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.frames: list[tuple[float, Image.Image]] = []

    def take(self) -> None:
        taken = Image.open(io.BytesIO(self.page.screenshot())).convert("RGB")
        size = WIDTH, round(WIDTH * taken.height / taken.width)
        self.frames.append((time.monotonic(), taken.resize(size, Image.Resampling.LANCZOS)))

    def until(self, seen: Callable[[], bool], patience: float = PATIENCE) -> None:
        """Film until something is seen. Raises TimeoutError."""
        end = time.monotonic() + patience
        while not seen():
            if time.monotonic() > end:
                self.page.screenshot(path=FAILED)
                raise TimeoutError(f"waited {patience:.0f} s in vain; {FAILED} shows the page")
            self.take()

    def for_seconds(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > end)

    def press(self, button: str, shown: Callable[[], bool]) -> None:
        """Press until it shows, as buttons that have just appeared ignore presses."""
        end = time.monotonic() + PATIENCE
        while not shown():
            if time.monotonic() > end:
                self.page.screenshot(path=FAILED)
                raise TimeoutError(f"{button}: pressed in vain; {FAILED} shows the page")
            if self.page.is_visible(button) and self.page.is_enabled(button):
                self.page.click(button)
            self.for_seconds(3.0)

    def save(self, path: Path) -> None:
        times = [at for at, _ in self.frames]
        lasted = [1e3 * (b - a) / FASTER for a, b in itertools.pairwise(times)]
        images = [image for _, image in self.frames]
        durations = [*(min(200, max(50, round(one))) for one in lasted), 2500]
        first, *others = images
        first.save(
            path,
            save_all=True,
            append_images=others,
            duration=durations,
            loop=0,
            quality=QUALITY,
            method=6,
            minimize_size=False,
        )


def fly(film: Film, link: str, still: Path) -> None:
    """Fly on the page with its own buttons, and film it."""
    page = film.page
    page.goto(link)
    page.wait_for_selector("#behaviors button")
    page.keyboard.press("Escape")  # the help of the first visit
    page.wait_for_selector("#arm:enabled", timeout=1e3 * PATIENCE)
    base = link.partition("/?")[0]

    def noise(sigma: float) -> None:
        body = {"values": {"station.bearings.sigma": sigma}}
        answer = page.request.put(f"{base}/api/parameters", data=body, headers={"origin": base})
        assert answer.ok, answer.text()

    def behavior() -> str:
        return str(page.request.get(f"{base}/api/summary").json()["status"]["behavior"])

    page.click("[data-tab=beacons]")
    box = page.locator("#scene").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    for _ in range(6):
        page.mouse.wheel(0, -120)
        page.wait_for_timeout(300)
    page.wait_for_timeout(3000)
    film.for_seconds(0.5)
    page.hover("#arm")
    page.mouse.down()
    film.until(lambda: page.is_visible("#take-off"))
    page.mouse.up()
    film.for_seconds(1.0)
    film.press("#take-off", lambda: behavior() != "ground")
    film.until(lambda: behavior() == "hover")
    film.for_seconds(1.0)
    page.click("#beacons-session button:text-is('Run in parallel')")
    film.for_seconds(2.0)
    back, over = "button:text-is('Back to tracker')", "button:text-is('Fly on bearings')"
    film.press(over, lambda: bool(page.is_visible(back)))
    film.for_seconds(6.0)
    shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    shot.quantize(256, dither=Image.Dither.NONE).save(still, optimize=True)
    for sigma in SIGMA:
        noise(sigma)
        film.for_seconds(1.5)
    film.for_seconds(3.0)
    page.click("#land")
    page.wait_for_timeout(1000)


def main(folder: Path) -> None:
    """Write the pictures into a folder."""
    from playwright.sync_api import sync_playwright

    with started(PORT, LINK_PORT, lockstep=True) as (_, lines), sync_playwright() as playwright:
        link = until(lambda: re.findall(r"http://\S+token=\S+", "".join(lines)))[-1]
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport=WINDOW, color_scheme="light")
        page.set_default_timeout(1e3 * PATIENCE)
        found = Film(page)
        try:
            fly(found, link, folder / "page.png")
        except Exception:
            print("".join(lines), file=sys.stderr)
            raise
        finally:
            found.save(folder / "flight.webp")
            browser.close()
    print(f"{len(found.frames)} frames, {(folder / 'flight.webp').stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "images")
