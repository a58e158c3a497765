"""Settings page and pre-flight check list on the Fly tab, in Chromium."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bearing_sim.emulator import BearingParameters
from bearing_sim.tracker import TrackerParameters
from console.catalogue.catalogue import Catalogue
from control.behaviors.parameters import BehaviorParameters
from quadrotor.parameters import Parameters, ParameterStore
from quadrotor.vehicle_model import VehicleModel
from vehicle_link.checks import Check, to_messages
from vehicle_link.messages import header, new
from web.access.accounts import Accounts
from web.access.database import AccessDatabase
from web.access.passwords import Passwords
from web.access.roles import Role

WORDS = "correct horse battery"
LINK = Check("link", "ok", "good", "good")
BATTERY = Check("battery", "fail", "13.2 V", "at least 14.0 V", "charge it")
STICKS = Check("sticks", "fail", "deflected by 40 %", "centred", "let go of them")
RIGHTS = Check("real-time rights", "fail", "refused", "SCHED_FIFO 50", "write it", "vehicle")


class _Station(Parameters):
    tracker: TrackerParameters = TrackerParameters()
    bearings: BearingParameters = BearingParameters()


class _Root(Parameters):
    model: VehicleModel = VehicleModel()
    behavior: BehaviorParameters = BehaviorParameters()
    station: _Station = _Station()


class Ground:
    """Vehicle on the ground, its station's list, and their site."""

    def __init__(self, site: Any) -> None:
        self.site, self.station = site, site.station
        with self.site.sign_in() as client:
            self.cookies = dict(client.cookies)
        self.checks, self.armed = [LINK], False
        self.found = [LINK, RIGHTS]
        answer = self.station._call_blocking

        def call(service: str, request: Any) -> Any:
            response = answer(service, request)
            if service == "checks" and response.accepted:
                response.checked, response.checks = time.time(), to_messages(self.found)
            return response

        self.station._call_blocking = call
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._closing.wait(0.05):
            stamp = header(time.time_ns())
            self.station.fly()
            status = new(
                "quadlab_msgs/VehicleStatus",
                header=stamp,
                armed=self.armed,
                mode="armed" if self.armed else "ready",
                behavior="ground",
                parameter_revision=self.station.store.revision,
            )
            self.station.put("status", status)
            ready = all(one.state != "fail" for one in self.checks)
            preflight = new(
                "quadlab_msgs/Preflight",
                header=stamp,
                ready=ready,
                armed=self.armed,
                blocks=True,
                checks=to_messages(self.checks),
            )
            self.station.put("preflight", preflight)

    def close(self) -> None:
        self._closing.set()
        self._thread.join()


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory, serve: Any) -> Iterator[Ground]:
    data = tmp_path_factory.mktemp("setup")
    catalogue = Catalogue(data)
    with serve(data, catalogue) as site:
        site.station.store = ParameterStore(_Root().model_copy(deep=True))
        ground = Ground(site)
        yield ground
        ground.close()
    catalogue.close()


@pytest.fixture
def ground(running: Ground) -> Ground:
    running.checks, running.armed = [LINK], False
    return running


@pytest.fixture
def open_tab(context: Any, ground: Ground) -> Iterator[Callable[[str], Any]]:
    """Yield a function that opens a page, signed in by the link; script errors fail the test."""
    problems: list[str] = []
    context.add_cookies(
        [{"name": n, "value": v, "url": ground.site.base} for n, v in ground.cookies.items()]
    )

    def open_at(path: str, script: str = "") -> Any:
        page = context.new_page()
        page.add_init_script(script)
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(f"{ground.site.base}{path}")
        return page

    yield open_at
    assert problems == []


def test_the_fly_tab_says_why_it_is_not_ready_and_so_does_the_arm_button(
    ground: Ground, open_tab: Any, look_at: Any
) -> None:
    ground.checks = [LINK, BATTERY, STICKS]
    page = open_tab("/#tab=gains&search=model.")
    look = look_at(page)
    page.wait_for_selector("#tab-gains", state="visible")
    look.value("#search", "model.")
    page.click("[data-tab=fly]")
    look.text("#preflight summary", "Fix *Not ready: 2 reasons *battery: 13.2 V")
    look.text("#preflight-note", "battery 13.2 V: charge it; sticks deflected by 40 %")
    assert page.get_attribute("#arm", "aria-describedby") == "preflight-note"
    page.wait_for_function("() => document.getElementById('arm').title.includes('battery 13.2 V')")
    page.press("#preflight summary", "Enter")
    look.text("#preflight li >> nth=0", "Fix *battery *13.2 V expected: at least 14.0 V *charge it")
    look.text("#preflight li >> nth=2", "OK *link *good")
    ground.checks = [LINK]
    look.text("#preflight summary", "OK *Ready to arm")
    look.text("#preflight-note", "^$")
    ground.armed = True
    look.text("#preflight summary", "Armed")
    assert page.locator("#preflight li").count() == 1, "what was open stays open"
    ground.armed = False
    look.text("#preflight summary", "Ready to arm")


def test_the_flight_volume_is_changed_by_numbers_and_drawn(
    ground: Ground, open_tab: Any, look_at: Any
) -> None:
    page = open_tab("/setup")
    look = look_at(page)
    look.value("#volume input >> nth=1", "3")
    x_max = page.get_by_label("x to")
    assert page.locator("#volume rect").count() == 2, "one box from above, one from the side"
    before = float(page.locator("#volume rect.confirmed").first.get_attribute("width"))
    x_max.fill("1,5")
    page.wait_for_selector("#volume rect.wanted")
    x_max.press("Enter")
    page.wait_for_selector("#volume rect.wanted", state="detached")
    look.value("#volume input >> nth=1", "1.5")
    assert ground.station.store.get("behavior.volume_x_max") == 1.5
    after = float(page.locator("#volume rect.confirmed").first.get_attribute("width"))
    tall = float(page.locator("#volume rect.confirmed").first.get_attribute("height"))
    assert before / tall == pytest.approx(6.0 / 6.0, abs=0.02)
    assert after / tall == pytest.approx(4.5 / 6.0, abs=0.02)
    x_max.fill("500")
    x_max.press("Enter")
    look.text("#volume .reason", "Not changed: behavior.volume_x_max")
    page.press("#volume input >> nth=1", "Escape")
    look.value("#volume input >> nth=1", "1.5")


def test_the_start_up_checks_stand_with_a_word_and_what_to_do(
    ground: Ground, open_tab: Any, look_at: Any
) -> None:
    page = open_tab("/setup")
    look = look_at(page)
    look.text("#checks-summary", "Fix")
    look.text("#checks section[aria-label=Vehicle] li", "Fix *real-time rights *refused")
    look.text("#checks section[aria-label=Vehicle] .advice", "^write it$")
    look.text("#checks section[aria-label='This browser'] li >> nth=0", "OK *secure context *yes")
    ground.found = [LINK, Check("real-time rights", "ok", "granted", place="vehicle")]
    page.click("text=Check again")
    look.text("#checks section[aria-label=Vehicle] li", "OK *real-time rights *granted")
    assert ground.station.requests[-1][0] == "checks"
    assert ground.station.requests[-1][1].again
    ground.found = [LINK, RIGHTS]


def test_vehicle_tracker_and_beacons_are_told_wherever_the_address_points(
    ground: Ground, open_tab: Any, look_at: Any
) -> None:
    before = """window.strips = []; // all that the strip on top ever says
        document.addEventListener('readystatechange', () => {
          const strip = document.getElementById('offline');
          new MutationObserver(() => strips.push(strip.textContent)).observe(strip,
            { childList: true }); }, { once: true })"""
    page = open_tab("/setup#1", before)  # the name of nothing, and not a valid CSS identifier
    look = look_at(page)
    look.text("#vehicles tbody tr >> nth=0", "quad1 *good *ready")
    look.text("#vehicles dl >> nth=1", "Mass *1.308 kg")
    look.text("#tracker dl", "simulated tracker.*100 Hz")
    look.value("#beacons tbody tr >> nth=0 >> input >> nth=1", "1.000")
    assert page.get_attribute("#vehicles p a", "href") == "/#tab=gains&search=model."
    assert page.evaluate("strips.filter((said) => said.includes('could not start'))") == []


def test_the_tracker_process_is_shown_with_its_bodies_its_latency_and_what_is_wrong(
    ground: Ground, open_tab: Any, look_at: Any
) -> None:
    status = new(
        "quadlab_msgs/TrackerStatus",
        system="vrpn at mocap:3883",
        body="cf7",
        seen=["cf7", "wand"],
        rates=np.array([99.0, 98.0]),
        frame_rate=100.0,
        latency=0.0012,
        latency_p99=0.0091,
        latency_counts=np.array([400, 300, 150, 80, 30, 20, 10, 5, 3, 2] + [0] * 22, np.uint32),
        gaps=3,
        jumps=1,
        problem="cf7 and wand have changed places",
        withheld=True,
        cameras=[new("quadlab_msgs/CameraFigures", name=name) for name in ("0", "1")],
    )
    page = open_tab("/setup")
    look = look_at(page)
    ground.station.put("tracker_status", status)
    look.text(
        "#tracker dl", "vrpn at mocap:3883.*cf7 .its poses are withheld.*cf7 99 Hz, wand 98 Hz"
    )
    look.text("#tracker dl", "median 1.2 ms, 99 % below 9.1 ms.*3 gaps, 1 jumps")
    look.text("#tracker > p.reason", "changed places|No data from the tracker process")
    assert page.locator("#tracker .latencies i").count() == 32
    page.locator("#tracker .pictures").scroll_into_view_if_needed()  # drawn only where it is seen
    look.text("#tracker .pictures > div:nth-child(2)", "camera 1: no pictures|No data")
    assert page.locator("#tracker .pictures > div:visible").count() == 2
    assert not page.is_visible("#tracker .fields")


def test_an_admin_adds_a_user_changes_the_role_and_deletes(
    ground: Ground, open_tab: Any, look_at: Any
) -> None:
    page = open_tab("/setup")
    look = look_at(page)
    look.value("#users [name=role]", "admin")
    assert page.is_disabled("#users [name=role]"), "the first account cannot be another's"
    for name, role in (("anna", "admin"), ("oleg", "operator")):
        page.fill("#users [name=name]", name)
        page.fill("#users [name=password]", WORDS)
        page.click("#users form button")
        look.text("#users .note", f"{name} was added as {role}")
        look.value("#users [name=role]", "operator")
    assert page.is_enabled("#users [name=role]")
    row = "#users tbody tr:has-text('oleg')"
    page.select_option(f"{row} select", "viewer")
    look.text("#users .note", "oleg is now viewer")
    page.click(f"{row} button[aria-label='delete oleg']")
    page.click(f"{row} button[aria-label='really delete oleg']")
    look.text("#users .note", "oleg is deleted")
    page.wait_for_selector(row, state="detached")
    page.fill("#users [name=name]", "vera")
    page.fill("#users [name=password]", "correct")
    assert not page.evaluate("document.querySelector('#users form').checkValidity()")
    page.click("text=For a viewer")
    page.wait_for_selector("#users .add input[readonly]", state="visible")
    assert "token=" in page.input_value("#users .add input[readonly]")


def test_a_viewer_sees_and_changes_nothing(ground: Ground, context: Any, look_at: Any) -> None:
    folder: Path = ground.site.data / "web"
    accounts = Accounts(AccessDatabase(folder), Passwords(1, 8))
    if not accounts.count():
        accounts.add("anna", Role.ADMIN, WORDS)
    accounts.add("vic", Role.VIEWER, WORDS)
    page = context.new_page()
    page.goto(f"{ground.site.base}/login")
    page.fill("input[name=name]", "vic")
    page.fill("input[name=password]", WORDS)
    page.click(".people button")
    page.wait_for_url(f"{ground.site.base}/", wait_until="commit")
    page.goto(f"{ground.site.base}/setup")
    look = look_at(page)
    look.text("#users tbody", "vic")
    look.value("#volume input >> nth=0", "-3")
    assert page.locator("#volume input:enabled, #tracker input:enabled").count() == 0
    assert page.locator("#users form, #users select, #users button").count() == 0
    assert page.get_by_text("Check again").is_disabled()
