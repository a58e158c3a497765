"""Every page in its main states: what axe-core says of it, and that it fits from 1024 x 700 to
2560 x 1440 and on a phone. With QUADLAB_IMAGES=folder the documentation's pictures are taken too.
"""

from __future__ import annotations

import importlib.util
import math
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from bearing_sim.emulator import BearingParameters
from bearing_sim.tracker import TrackerParameters
from benchmarks.recorded_run import MadeRun, write_run
from console.catalogue import Catalogue
from console.catalogue_notes import write_notes
from console.catalogue_tags import change_tags
from console.comparison.parameters import ComparisonParameters
from console.parameter_history import ParameterChange, ParameterHistory
from console.run_files import tidy_runs
from control.behaviors.parameters import BehaviorParameters
from control.parameters import ControlParameters
from estimation.parameters import EstimationParameters
from quadrotor.parameters import Parameters, ParameterStore
from quadrotor.vehicle_model import VehicleModel
from vehicle_link.checks import Check, to_messages
from vehicle_link.messages import header, new
from web.access.accounts import Accounts
from web.access.database import AccessDatabase
from web.access.passwords import Passwords
from web.access.roles import Role

IMAGES = os.environ.get("QUADLAB_IMAGES")  # folder for the documentation's pictures
RUN, LATER = "20260131T093042Z_quad1", "20260131T100000Z_quad1"
SIZES = ((1440, 900), (1024, 700), (2560, 1440))
PHONE = (390, 800)
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]
CHANGES = (
    ("control.position.kp_xy", 4.0, 4.4), ("control.position.kp_z", 8.0, 8.6),
    ("control.position.kp_xy", 4.4, 4.8),
)  # fmt: skip
SCENE = "<!doctype html><html lang=en><title>3D view</title><body style='background:#0d1115'>"
FOUND = [
    Check("link", "ok", "good", "good"),
    Check("clock", "warn", "not synchronised", "synchronised", "start chrony", "vehicle"),
    Check("real-time rights", "fail", "refused", "SCHED_FIFO 50", "write limits.d", "vehicle"),
]


class _Station(Parameters):
    bearings: BearingParameters = BearingParameters()
    comparison: ComparisonParameters = ComparisonParameters()
    tracker: TrackerParameters = TrackerParameters()


class _Root(Parameters):
    model: VehicleModel = VehicleModel()
    control: ControlParameters = ControlParameters()
    behavior: BehaviorParameters = BehaviorParameters()
    estimation: EstimationParameters = EstimationParameters()
    station: _Station = _Station()


def circle(station: Any, t: float) -> None:
    """One sample of a vehicle that flies a circle; t in s."""
    stamp, angle, lag = header(time.time_ns()), 0.8 * t, 0.06
    wobble = 0.012 * math.sin(3.1 * t)

    def place(a: float) -> tuple[float, float, float]:
        return (1.2 * math.cos(a), 1.2 * math.sin(a), 1.2 + 0.15 * math.sin(0.5 * a))

    x, y, z = place(angle - lag)
    half = 0.5 * 0.12
    pose = {"pose": {"position": (x + wobble, y, z), "orientation": (half, half, 0.0, 0.995)}}
    truth = {"pose": {"position": (x, y + 0.004, z), "orientation": (half, half, 0.0, 0.995)}}
    twist = {"twist": {"linear": (-0.96 * math.sin(angle), 0.96 * math.cos(angle), wobble),
                       "angular": (wobble, 0.4 * wobble, 0.1)}}  # fmt: skip
    put = station.put
    moving = ("state", "truth", "reference")
    station.put = lambda topic, message: None if topic in moving else put(topic, message)
    station.fly()
    station.put = put
    station.put("state", new("nav_msgs/Odometry", header=stamp, pose=pose, twist=twist))
    station.put("truth", new("nav_msgs/Odometry", header=stamp, pose=truth, twist=twist))
    station.put("reference", new("quadlab_msgs/Reference", header=stamp, position=place(angle)))
    station.put(
        "preflight",
        new("quadlab_msgs/Preflight", header=stamp, ready=True, armed=True, blocks=True,
            checks=to_messages(FOUND[:1])),
    )  # fmt: skip


def step_vehicle(station: Any) -> Any:
    spec = importlib.util.spec_from_file_location(
        "step_vehicle", Path(__file__).parents[1] / "step_vehicle.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # where pydantic looks names up
    spec.loader.exec_module(module)
    return module.StepVehicle(station)


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory, serve: Any) -> Iterator[Any]:
    """A site with two runs, two step tests, a history of gains, an account and a flight."""
    data = tmp_path_factory.mktemp("states")
    made = MadeRun(16.0, silence=(9.0, 9.5), marks=[(7.0, "gust")])
    write_run(data / "runs" / f"{RUN}.mcap", made)
    write_run(data / "runs" / f"{LATER}.mcap", MadeRun(16.0, late=1.0), seed=2)
    catalogue = Catalogue(data)
    tidy_runs(catalogue)
    change_tags(catalogue, [RUN], ["figure 8", "wind"], [])
    write_notes(catalogue, RUN, "Gust from the door at 7 s; held.", "anna")
    database = AccessDatabase(data / "web")
    Accounts(database, Passwords(1, 8)).add("anna", Role.ADMIN, "correct horse battery")
    history, began_ns = ParameterHistory(catalogue.engine, "quad1"), time.time_ns() - 60 * 10**9
    history.begin_flight("run9", began_ns)
    for k, (name, old, value) in enumerate(CHANGES):
        at_ns = began_ns + 15 * 10**9 * k
        history.add([ParameterChange(name, old, value, "anna", at_ns, k, "run9", at_ns)])
    with serve(data, catalogue) as site:
        ended = threading.Event()
        site.vehicle = step_vehicle(site.station)
        site.station.store = ParameterStore(_Root().model_copy(deep=True))
        answer = site.station._call_blocking

        def call(service: str, request: Any) -> Any:
            response = answer(service, request)
            if service == "checks":
                response.checked, response.checks = time.time(), to_messages(FOUND)
            return response

        def fly() -> None:
            compare_at = 0.0
            while not ended.wait(0.02):
                t = time.monotonic()
                circle(site.station, t)
                if t > compare_at:
                    compare_at = t + 0.2
                    site.station.compare(("vehicle", "error_state"))

        site.station._call_blocking = call
        thread = threading.Thread(target=fly, daemon=True)
        thread.start()
        yield site
        ended.set()
        thread.join()
    catalogue.close()


@dataclass
class Room:
    """One browser page that goes from state to state."""

    page: Any
    lab: Any

    def console(self, tab: str) -> None:
        if self.page.url.split("#")[0] != f"{self.lab.base}/":
            self.page.goto(f"{self.lab.base}/")
        self.page.wait_for_selector("#behaviors button", state="attached")
        self.page.keyboard.press("Escape")
        self.page.click(f"[data-tab={tab}]")

    def go(self, path: str, ready: str) -> None:
        self.page.goto(f"{self.lab.base}{path}")
        self.page.wait_for_selector(ready)


@pytest.fixture(scope="module")
def room(lab: Any, chromium: Any) -> Iterator[Room]:
    problems: list[str] = []
    context = chromium.new_context(viewport={"width": 1440, "height": 900})
    context.set_default_timeout(20_000)
    page = context.new_page()
    page.on("pageerror", lambda error: problems.append(f"{error}\n{error.stack}"))
    page.route("**/viser/**", lambda route: route.fulfill(body=SCENE, content_type="text/html"))
    page.goto(f"{lab.base}/?token={lab.token}")
    page.wait_for_selector("#behaviors button")
    if IMAGES:
        page.wait_for_timeout(15_000)  # so that the charts are full
    yield Room(page, lab)
    context.close()
    assert problems == []


# ------------------------------------------------------------------------------- states
def fly(room: Room) -> None:
    room.console("fly")


def guide(room: Room) -> None:
    room.console("fly")
    if room.page.locator("#help-panel[open]").count() == 0:
        room.page.click("#help")
    room.page.wait_for_selector("#help-panel[open]")


def people(room: Room) -> None:
    room.console("fly")
    room.page.click("#who")
    room.page.wait_for_selector("#users .user >> nth=0")


def gains(room: Room) -> None:
    room.console("gains")
    room.page.fill("#search", "control.position")
    room.page.wait_for_selector(".gain >> visible=true")


def gains_history(room: Room) -> None:
    room.console("gains")
    room.page.click("#parameter-views button >> nth=0")
    room.page.wait_for_selector(".timeline li .values")


def tune(room: Room) -> None:
    room.console("tune")
    boxes = room.page.locator(".tests input[type=checkbox]")
    for count in (1, 2):
        if boxes.count() < count:
            room.page.wait_for_selector("#tab-tune .act button:enabled >> nth=0")
            room.page.click("#tab-tune .act button >> nth=0")
            boxes.nth(count - 1).wait_for()
            room.lab.vehicle.zeta = 0.7
    for box in boxes.all():
        box.check()


def beacons(room: Room) -> None:
    room.console("beacons")
    room.page.wait_for_selector("#beacons-errors .estimate")


def link(room: Room) -> None:
    room.console("link")


def signals(room: Room) -> None:
    room.console("fly")
    room.page.click("#chart-0 button:text-is('Signals')")
    room.page.wait_for_selector(".menu.signals details")


def charts(room: Room) -> None:
    room.console("fly")
    room.page.keyboard.press("Escape")
    room.page.click("#chart-0 [aria-label=expand]")
    room.page.wait_for_selector("#chart-0.expanded")


def pad_editor(room: Room) -> None:
    room.console("fly")
    if room.page.locator("#chart-0.expanded").count():
        room.page.click("#chart-0 [aria-label=expand]")
    room.page.evaluate(
        """() => { const pad = { id: "Wireless Controller", index: 0, connected: true,
        mapping: "standard", axes: [0, 0, 0, 0],
        buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })) };
        navigator.getGamepads = () => [pad]; }"""
    )
    room.page.click("#sticks button:text-is('Set up pad')")


def runs(room: Room) -> None:
    room.go("/runs", "#list tr[data-index]")
    room.page.click("#list tr[data-index] >> nth=1")
    room.page.wait_for_selector("#detail h2")


def replay(room: Room) -> None:
    room.go(f"/replay/{RUN}?with={LATER}#t=9", "main[data-shown]")


def setup(room: Room) -> None:
    room.go("/setup", "#checks li")
    room.page.wait_for_selector("#volume rect.confirmed >> nth=0")


def kill(room: Room) -> None:
    room.go("/kill", "#cut")


def sign_in(room: Room) -> None:
    room.page.context.clear_cookies()
    room.go("/login", "form.people")


STATES: list[Callable[[Room], None]] = [
    guide, people, fly, gains, gains_history, beacons, link, tune, signals, charts, pad_editor,
    runs, replay, setup, kill, sign_in,
]  # fmt: skip
CROOKED = Path(__file__).with_name("crooked.js").read_text()


@pytest.fixture(scope="module")
def axe() -> str:
    package = pytest.importorskip("axe_playwright_python", reason="axe-core is not installed")
    return (Path(package.__file__).parent / "axe.min.js").read_text()


def violations(page: Any, axe: str) -> list[str]:
    """Serious and critical ones, one line each. The 3D view is viser's page."""
    if not page.evaluate("'axe' in window"):
        page.evaluate(axe)
    found = page.evaluate(
        """(tags) => axe.run({ exclude: ["#scene"] },
        { runOnly: tags, resultTypes: ["violations"], iframes: false })""",
        RULES,
    )
    return [
        f"{one['id']}: {' '.join(node['target'])} {node['failureSummary'].splitlines()[-1].strip()}"
        for one in found["violations"]
        if one["impact"] in ("serious", "critical")
        for node in one["nodes"]
    ]


def picture(page: Any, name: str) -> None:
    """PNG of at most 256 colours."""
    import io

    from PIL import Image

    shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    shot.quantize(256, dither=Image.Dither.NONE).save(Path(IMAGES or "") / name, optimize=True)


@pytest.mark.parametrize("state", STATES, ids=lambda one: one.__name__)
def test_a_state_is_accessible_and_nothing_is_crooked(
    room: Room, axe: str, state: Callable[[Room], None]
) -> None:
    page = room.page
    state(room)
    found = violations(page, axe)
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate("() => new Promise((done) => requestAnimationFrame(() => setTimeout(done)))")
        found += [f"at {width} x {height}: {line}" for line in page.evaluate(CROOKED)]
    width, height = SIZES[0]
    page.set_viewport_size({"width": width, "height": height})
    if IMAGES:
        page.wait_for_timeout(500)
        picture(page, f"{state.__name__}.png")
    assert found == []


def test_a_viewer_on_a_phone_has_everything_within_the_width(
    room: Room, chromium: Any, lab: Any, axe: str
) -> None:
    with lab.sign_in() as admin, lab.invited(admin, "viewer") as viewer:
        cookies = [{"name": n, "value": v, "url": lab.base} for n, v in viewer.cookies.items()]
    width, height = PHONE
    context = chromium.new_context(viewport={"width": width, "height": height})
    context.add_cookies(cookies)
    page, found = context.new_page(), []
    page.route("**/viser/**", lambda route: route.fulfill(body=SCENE, content_type="text/html"))
    for path, ready in (
        ("/", "#behaviors button"), ("/runs", "#list tr[data-index]"), ("/setup", "#checks li"),
        (f"/replay/{RUN}", "main[data-shown]"), ("/kill", "#cut"),
    ):  # fmt: skip
        page.goto(f"{lab.base}{path}")
        page.wait_for_selector(ready)
        page.keyboard.press("Escape")
        found += [f"{path}: {line}" for line in page.evaluate(CROOKED)]
        if IMAGES and path == "/":
            page.wait_for_timeout(8000)
            picture(page, "phone.png")
    found += violations(page, axe)
    context.close()
    assert found == []


def test_tab_goes_through_everything_in_order_and_the_focus_is_seen(
    chromium: Any, lab: Any
) -> None:
    with lab.sign_in() as admin:
        cookies = [{"name": n, "value": v, "url": lab.base} for n, v in admin.cookies.items()]
    context = chromium.new_context(viewport={"width": 1440, "height": 900})
    context.add_cookies(cookies)
    page = context.new_page()
    page.route("**/viser/**", lambda route: route.fulfill(body=SCENE, content_type="text/html"))
    page.goto(f"{lab.base}/")
    page.wait_for_selector("#behaviors button")
    page.wait_for_selector("#arm:enabled")
    page.keyboard.press("Escape")  # the help of the first visit
    page.reload()  # to begin at the beginning
    page.wait_for_selector("#arm:enabled")
    page.wait_for_selector("#who:not(:empty)")  # the keys are there
    page.keyboard.press("2")  # the Gains tab
    page.wait_for_selector("#tab-gains", state="visible")
    wanted = [
        "arm", "take-off", "land", "emergency-land", "cut", "who", "help", "follow", "open-gains",
        "search",
    ]  # fmt: skip
    passed, unseen = [], []
    for _ in range(40):
        page.keyboard.press("Tab")
        name, is_seen = page.evaluate(
            """() => { const at = document.activeElement, look = getComputedStyle(at);
            return [at.id, at.tagName === 'IFRAME' || look.outlineStyle !== 'none']; }"""
        )
        passed.append(name)
        if not is_seen:
            unseen.append(name)
        if name == wanted[-1]:
            break
    context.close()
    assert [name for name in passed if name in wanted] == wanted
    assert unseen == []
