"""docs/images/*.png: the pages of a running `quadlab up`, in headless Chromium.

    python -m scripts.docs.pictures [NAME…]

A simulated vehicle is flown as a person would fly it: two flights with a figure 8, gains changed in
between, step tests, sticks, bearings and calibrations. The 3D view is drawn in software. Without
names all pictures are taken; it takes some minutes.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from PIL import Image

import quadlab
from benchmarks.harness import CHROMIUM
from benchmarks.page.laboratory import started, until
from benchmarks.page.late_ticks import DRAWING
from benchmarks.page.up_cost import PATIENCE, Pilot, pilot
from extensions.reports.report import write_report
from quadrotor.checkout import ROOT

PORT, LINK_PORT = 28140, 28510
WINDOW, PHONE = {"width": 1440, "height": 900}, {"width": 390, "height": 844}
REPORT = {"width": 760, "height": 1492}
FOLDER = ROOT / "docs/images"
OTHERS = {"faults", "loop_rate", "peers"}  # drawn by benchmarks and scripts.docs.peers_chart
DRAWN, SETTLED = 12_000, 2000
"""Time in ms until the 3D view is drawn, at the few frames of software, and until charts are."""
BOUND = 120_000  # ms
ANNA = {"name": "anna", "password": "correct horse battery"}
STEP = {"axis": "x", "amplitude": 0.3, "duration": 2.0}
GAIN = "control.position.kp_xy"
PAD = """() => {
  const button = { pressed: false, value: 0 };
  globalThis.pad = { id: "Xbox 360 Controller", index: 0, connected: true, mapping: "standard",
    get timestamp() { return performance.now(); },
    axes: [0, 0, 0, 0], buttons: Array.from({ length: 17 }, () => ({ ...button })) };
  navigator.getGamepads = () => [globalThis.pad];
}"""
ALL_PIXELS = "() => { __viserTestpoints.devSettings.set({ fixedDpr: 1 }); }"
"""For viser, which would draw fewer where it is slow."""
SHOULDER = "() => { globalThis.pad.buttons[5] = { pressed: true, value: 1 }; }"
FORWARD_RIGHT = "() => { globalThis.pad.axes = [0.8, 0, 0, -0.7]; }"
"""A gamepad: its shoulder button is held, then its sticks fly forward and turn right."""


class Photographer:
    """A signed-in page and the pilot of its vehicle.

    Args:
        names: pictures to take; empty for all.
    """

    def __init__(self, browser: Any, flown: Pilot, names: set[str]) -> None:
        self.flown, self.names = flown, names
        self.browser = browser
        self.cookies = flown.cookies()
        self.page = self.opened(WINDOW)

    def opened(
        self,
        size: dict[str, int],
        *,
        signed_in: bool = True,
        touch: bool = False,
        view: bool = False,
    ) -> Any:
        """Return a page of a new browser profile in the light theme.

        Args:
            view: whether the 3D view is drawn, for which software needs a whole processor.
        """
        context = self.browser.new_context(
            viewport=size, color_scheme="light", reduced_motion="reduce", has_touch=touch
        )
        context.set_default_timeout(BOUND)
        if signed_in:
            context.add_cookies(self.cookies)
        page = context.new_page()
        if not view:
            page.route("**/viser/**", lambda route: route.fulfill(status=200, body=""))
        return page

    @contextmanager
    def viewed(
        self, size: dict[str, int], tab: str = "fly", *, touch: bool = False
    ) -> Iterator[Any]:
        """Yield another page of the console, with the 3D view."""
        page = self.opened(size, touch=touch, view=True)
        page.goto(self.flown.base)
        page.locator("#behaviors button").first.wait_for()
        page.keyboard.press("Escape")  # the help of the first visit, where it is open
        page.click(f"[data-tab={tab}]")
        page.wait_for_timeout(SETTLED)
        page.click("#view summary")
        page.locator("#view .layers label", has_text="Full quality").locator("input").check()
        page.click("#view summary")
        page.wait_for_timeout(DRAWN)
        page.frames[-1].evaluate(ALL_PIXELS)
        page.wait_for_timeout(DRAWN)
        yield page
        page.context.close()

    def take(self, name: str, place: str = "", page: Any = None) -> None:
        """Write docs/images/NAME.png of the page, or of one element of it."""
        page = page or self.page
        if self.names and name not in self.names:
            return
        taken = (page.locator(place) if place else page).screenshot()
        shot = Image.open(io.BytesIO(taken)).convert("RGB")
        most, plain = Image.Quantize.MAXCOVERAGE, Image.Dither.NONE
        few = shot.quantize(256, method=most, kmeans=3, dither=plain)  # rare colours stay exact
        few.save(FOLDER / f"{name}.png", optimize=True)
        print(f"{name}.png", flush=True)

    def console(self, tab: str) -> None:
        """Show a tab of the console."""
        if self.page.url.split("#")[0].rstrip("/") != self.flown.base:
            self.page.goto(self.flown.base)
            self.page.locator("#behaviors button").first.wait_for()
        self.page.keyboard.press("Escape")
        self.page.click(f"[data-tab={tab}]")

    def visit(self, path: str, ready: str) -> None:
        """Show another page."""
        self.page.goto(f"{self.flown.base}{path}")
        self.page.locator(ready).first.wait_for()

    def put(self, path: str, **body: Any) -> None:
        self.flown.browser.put(path, json=body).raise_for_status()

    def post(self, path: str, **body: Any) -> None:
        self.flown.browser.post(path, json=body).raise_for_status()

    def set(self, name: str, value: float | str) -> None:
        """Change a parameter of the vehicle."""
        self.put("/api/parameters", values={name: value})

    def behavior(self) -> str:
        status = self.flown.summary().get("status") or {}
        return str(status.get("behavior", ""))


def signed_in(browser: Any, flown: Pilot, names: set[str]) -> Photographer:
    """Add the account anna, sign in with it, and return its page."""
    flown.browser.post("/api/users", json=ANNA | {"role": "admin"})
    camera = Photographer(browser, flown, names)
    camera.visit("/login", "form.people")
    camera.take("sign_in")
    for field, text in ANNA.items():
        camera.page.fill(f"input[name={field}]", text)
    camera.page.click("form.people button")
    camera.page.locator("#behaviors button").first.wait_for()
    camera.cookies = camera.page.context.cookies()
    flown.browser.cookies.clear()
    for one in camera.cookies:
        flown.browser.cookies.set(one["name"], one["value"])
    return camera


def on_the_ground(camera: Photographer) -> None:
    """Take the pages that need no flight."""
    camera.visit("/setup", "#checks li")
    camera.page.locator("#volume rect.confirmed").first.wait_for()
    camera.page.locator("#vehicles td", has_text="ready").wait_for()
    camera.take("setup")
    camera.post("/api/camera", camera="simulated")
    camera.page.locator("#camera .counts dd", has_text="3 of").first.wait_for()
    camera.take("camera_guide", "#camera")
    camera.post("/api/camera/cancel")
    camera.console("calibrate")
    camera.post("/api/experiments/start", name="accelerometer")
    camera.page.locator("#tab-calibrate .sphere .held").nth(4).wait_for()
    camera.take("calibrating", "#side")
    camera.page.locator("#tab-calibrate .outcome .found").wait_for()
    camera.take("calibrate", "#side")
    camera.post("/api/experiments/reject")


def first_flight(camera: Photographer) -> None:
    """Fly an 8, change gains, and take the tabs of the console."""
    camera.flown.take_off()
    camera.console("fly")
    camera.flown.start(
        "follow_trajectory", "follow_trajectory", trajectory="figure_eight", laps=6, period=8
    )
    with camera.viewed(WINDOW) as page:
        camera.take("fly", page=page)
    with camera.viewed(PHONE, touch=True) as page:
        camera.take("phone", page=page)
        page.goto(f"{camera.flown.base}/kill")
        page.locator("#cut").wait_for()
        page.wait_for_timeout(SETTLED)
        camera.take("kill", page=page)
    camera.page.click("#chart-0 [aria-label=expand]")
    camera.page.wait_for_timeout(SETTLED)
    camera.take("charts")
    camera.page.click(".chart.expanded [aria-label=expand]")
    for value in (4.5, 5.0, 4.6):
        camera.set(GAIN, value)
    camera.console("gains")
    camera.page.fill("#search", "control.position")
    camera.page.locator(".gain >> visible=true").first.wait_for()
    camera.take("gains", "#side")
    camera.page.fill("#search", "")
    camera.page.click("#parameter-views button >> nth=0")
    camera.page.locator(".timeline li .values").first.wait_for()
    camera.take("gains_history", "#side")
    camera.console("link")
    camera.page.wait_for_timeout(SETTLED)
    camera.take("link", "#side")
    until(lambda: camera.behavior() == "hover", 4 * PATIENCE)


def step_tests(camera: Photographer) -> None:
    """Fly two step tests, the second with more damping, and show both."""
    camera.console("tune")
    boxes = camera.page.locator(".tests input[type=checkbox]")
    for count, damping in enumerate((2.5, 3.5), 1):
        camera.set("control.position.kv_xy", damping)
        until(lambda: camera.flown.browser.post("/api/tuning/run", json=STEP).is_success, PATIENCE)
        boxes.nth(count - 1).wait_for()
    camera.page.wait_for_timeout(SETTLED)
    camera.take("tune", "#side")


def land(camera: Photographer) -> None:
    """Land, and wait until the motors are off and the run has ended."""
    camera.flown.start("land", "ground")
    until(lambda: not camera.flown.summary()["station"]["recording"], PATIENCE)


def bearings_and_sticks(camera: Photographer) -> None:
    """Show the map of the bound, with a shadow on bearings, then fly by a gamepad's sticks."""
    camera.console("beacons")
    camera.set("estimation.shadow_source", "bearings")
    camera.set("estimation.shadow", "error_state")
    camera.put("/api/beacons/view", map=True)
    with camera.viewed(WINDOW, "beacons") as page:
        camera.take("bound_map", "#view", page)
    camera.put("/api/beacons/view", map=False)
    camera.console("fly")
    camera.page.evaluate(PAD)
    camera.page.locator("#sticks", has_text="Xbox").wait_for()
    camera.flown.start("velocity", "velocity")
    camera.page.evaluate(SHOULDER)
    camera.page.locator("#sticks .on, #sticks.on").first.wait_for()
    camera.page.evaluate(FORWARD_RIGHT)
    camera.page.wait_for_timeout(SETTLED / 2)
    camera.page.locator("#sticks").scroll_into_view_if_needed()
    camera.take("sticks", "#side")
    camera.page.evaluate(PAD)  # centred, and its button released
    land(camera)


def recorded(camera: Photographer) -> None:
    """Fly once more with a softer gain, and show the two flights' runs."""
    camera.set(GAIN, 3.0)
    camera.flown.take_off()
    camera.flown.start(
        "follow_trajectory", "follow_trajectory", trajectory="figure_eight", laps=1, period=8
    )
    camera.post("/api/marks", id="picture1", text="gust from the door", ago=0.0)
    until(lambda: camera.behavior() == "hover", PATIENCE)
    land(camera)
    runs = [one["id"] for one in camera.flown.browser.get("/api/runs").json()]
    run, earlier = runs[:2]
    camera.put(f"/api/runs/{run}/notes", notes="Softer horizontal gain.")
    camera.post("/api/tags", runs=[run], add=["figure 8"])
    camera.visit("/runs", "#list tr[data-index] .state:text('complete')")
    camera.page.click("#list tr[data-index] >> nth=0")
    camera.page.locator("#detail h2").wait_for()
    camera.take("runs")
    camera.visit(f"/replay/{run}?with={earlier}#t=12", "main[data-shown]")
    camera.page.wait_for_timeout(SETTLED)
    camera.take("replay")
    camera.visit(f"/compare?run={run}&run={earlier}", "#parameters h2")
    camera.page.locator("#signals .plot canvas").nth(5).wait_for()
    camera.page.wait_for_timeout(SETTLED)
    camera.take("compare")


def report(camera: Photographer) -> None:
    """Take the head of the report of an experiment in simulated time."""
    with tempfile.TemporaryDirectory() as folder:
        log = quadlab.fly("figure_eight", seed=1, out=Path(folder)).path
        page, *_ = write_report(log, Path(folder), pdf=False)
        sheet = camera.opened(REPORT, signed_in=False)
        sheet.goto(page.as_uri())
        camera.take("report", page=sheet)
        sheet.context.close()


@contextmanager
def laboratory(names: set[str]) -> Iterator[Photographer]:
    """Yield the photographer of a new laboratory, signed in."""
    from playwright.sync_api import sync_playwright

    began = time.monotonic()
    with (
        started(PORT, LINK_PORT, lockstep=True) as (_, lines),
        pilot(lines, PORT, began) as flown,
        sync_playwright() as driver,
    ):
        browser = driver.chromium.launch(executable_path=shutil.which(CHROMIUM), args=[*DRAWING])
        yield signed_in(browser, flown, names)
        browser.close()


def main(names: set[str]) -> None:
    """Take the pictures. Raises SystemExit for a name that no picture has."""
    known = {path.stem for path in FOLDER.glob("*.png")} - OTHERS
    if unknown := sorted(names - known):
        raise SystemExit(f"no picture is called {unknown[0]}; there are {', '.join(sorted(known))}")
    with laboratory(names) as camera:
        for part in (
            on_the_ground,
            first_flight,
            step_tests,
            bearings_and_sticks,
            recorded,
            report,
        ):
            part(camera)


if __name__ == "__main__":
    main(set(sys.argv[1:]))
