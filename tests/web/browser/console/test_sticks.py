"""Sticks in Chromium, with a real station: what turns them on, what drops them, set-up of pads.

Playwright cannot press a pad or really take the focus away: the Gamepad API is replaced by an
object that the tests move, and events are dispatched.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from control.behaviors.parameters import BehaviorParameters
from quadrotor.parameters import Parameters, ParameterStore
from tests.support.subscribers import has_subscriber
from vehicle_link.messages import decode, header, new
from vehicle_link.parameters.messages import from_parameters
from vehicle_link.topics.control_inputs import decode_joy, encode_heartbeat
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received
from web.live.station import Station

PAD = """([id, mapping]) => {
  window.pad = { id, index: 0, connected: true, mapping, axes: [0, 0, 0, 0],
    buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })),
    get timestamp() { return performance.now(); } };
  window.plugged = true;
  navigator.getGamepads = () => [window.plugged ? window.pad : null];
  document.hasFocus = () => true;
}"""
PILOT = """() => { // holds the button, pressed again should a busy machine have dropped the sticks
  window.wanted = [0, 0, 0, 0];
  setInterval(() => {
    const isOn = document.getElementById('sticks').classList.contains('on');
    window.pad.buttons[4].pressed = isOn || !window.pad.buttons[4].pressed;
    window.pad.axes = isOn ? window.wanted : [0, 0, 0, 0];
  }, 100);
}"""
XBOX = "Xbox 360 Controller (STANDARD GAMEPAD Vendor: 045e Product: 028e)"
SHOULDER, B, BACK = 4, 1, 8
BOUND = 20_000  # ms, for a broken page only
DROPS = {
    "blur": ("dispatchEvent(new Event('blur'))", "the window lost focus"),
    "hidden": (
        """(() => { Object.defineProperty(document, 'hidden', { value: true, configurable: true });
        document.dispatchEvent(new Event('visibilitychange')); delete document.hidden; })()""",
        "the tab is hidden",
    ),
    "left": ("dispatchEvent(new Event('pagehide'))", "the page was left"),
    "unplugged, told": (
        "window.plugged = false; dispatchEvent(new Event('gamepaddisconnected'))",
        "the pad was unplugged",
    ),
    "unplugged, not told": ("window.plugged = false", "the pad was unplugged"),
}


class Pad:
    """Pad that the page sees."""

    def __init__(self, page: Any, id: str = XBOX, mapping: str = "standard") -> None:
        self._page = page
        page.evaluate(PAD, [id, mapping])

    def button(self, index: int, pressed: bool) -> None:
        self._page.evaluate(
            "([i, on]) => { window.pad.buttons[i] = { pressed: on, value: Number(on) }; }",
            [index, pressed],
        )

    def axis(self, index: int, value: float) -> None:
        self._page.evaluate("([i, v]) => { window.pad.axes[i] = v; }", [index, value])

    def seen(self) -> None:
        """Wait until the page has read the pad again."""
        self._page.evaluate(
            """() => new Promise((done) => { let ticks = 0;
            const clock = new Worker('/static/sticks/clock.js');
            clock.onmessage = () => { if (++ticks > 3) { clock.terminate(); done(); } }; })"""
        )


class Cockpit:
    """Station in a separate process, a web process on it, and a node that receives."""

    def __init__(self, data: Path, serve: Any) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        self._station = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "quadlab",
                "station",
                "--data",
                str(data),
                "--vehicle",
                "127.0.0.1:9",
                "--loopback-port",
                str(port),
            ],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        )
        assert self._station.stdout is not None
        assert "serves" in self._station.stdout.readline()
        self._session = loopback_session(port)
        self._node = Node(self._session, "/quad1", "observer")
        self.joys: list[Any] = []
        self.reasons: list[str] = []
        self._node.subscribe("joy", TOPICS["joy"].type_name, self._on_joy)
        self._node.subscribe("stick_status", TOPICS["stick_status"].type_name, self._on_answer)
        heartbeat = self._node.advertise(TOPICS["vehicle_heartbeat"])
        assert has_subscriber(heartbeat, 10.0)
        heartbeat.put(encode_heartbeat(1, 0))  # from a vehicle that accepts sticks from anyone
        self._catalogue = Catalogue(data)
        self._serving = serve(
            data, self._catalogue, kind=Station, open_session=lambda: loopback_session(port)
        )
        self.site = self._serving.__enter__()

    def _on_joy(self, received: Received) -> None:
        self.joys.append(decode_joy(received.payload))

    def _on_answer(self, received: Received) -> None:
        answer = decode(received.payload, TOPICS["stick_status"].type_name)
        self.reasons.append(str(answer.reason))

    @property
    def flies(self) -> bool:
        """Return whether the last command to the vehicle is to follow the sticks."""
        return bool(self.joys) and self.joys[-1].enabled

    def close(self) -> None:
        self._serving.__exit__(None, None, None)
        self._catalogue.close()
        self._node.close()
        self._session.close()
        self._station.terminate()
        self._station.wait(20)


@pytest.fixture(scope="module")
def cockpit(tmp_path_factory: pytest.TempPathFactory, serve: Any) -> Iterator[Cockpit]:
    made = Cockpit(tmp_path_factory.mktemp("data"), serve)
    yield made
    made.close()


@pytest.fixture(scope="module")
def browser(chromium: Any, cockpit: Cockpit) -> Iterator[Any]:
    """Yield one signed-in browser: the person who flies stays the same."""
    made = chromium.new_context(viewport={"width": 1440, "height": 900})
    made.set_default_timeout(BOUND)
    first = made.new_page()
    first.goto(f"{cockpit.site.base}/?token={cockpit.site.token}")
    first.wait_for_selector("#sticks .note")
    first.close()
    yield made
    made.close()


@pytest.fixture
def flown(browser: Any, cockpit: Cockpit) -> Iterator[Any]:
    """Yield a page on the real station, the same for all tests until one closes it."""
    if not browser.pages:
        made = browser.new_page()
        made.goto(cockpit.site.base)
        made.wait_for_selector("#sticks .note")
    page = browser.pages[0]
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(f"{error}\n{error.stack}"))
    yield page
    if not page.is_closed():
        page.evaluate("window.plugged = false")
    assert problems == []


@pytest.fixture
def fly(flown: Any, cockpit: Cockpit, until: Any) -> Callable[..., None]:
    """Return a function that presses the pad's button, then pushes its axes.

    It retries, in case a busy machine drops the sticks, until the vehicle would get what was asked.
    """

    def press(
        pad: Pad, pushed: dict[int, float] | None = None, arrives: Any = lambda joy: True
    ) -> None:
        def on() -> bool:
            for axis in pushed or {}:
                pad.axis(axis, 0.0)
            pad.button(SHOULDER, False)
            pad.seen()
            pad.button(SHOULDER, True)
            pad.seen()
            if cockpit.flies:
                for axis, value in (pushed or {}).items():
                    pad.axis(axis, value)
                pad.seen()
            return cockpit.flies and bool(arrives(cockpit.joys[-1]))

        until(on)

    return press


@pytest.mark.parametrize("drop", list(DROPS))
def test_each_drop_stops_the_vehicle_says_why_and_needs_a_release(
    flown: Any, cockpit: Cockpit, fly: Any, until: Any, drop: str
) -> None:
    script, cause = DROPS[drop]
    pad = Pad(flown)

    def said() -> int:
        item = flown.locator("#events li", has_text=f"dropped: {cause}")
        times = item.locator("b").text_content() if item.count() else "0"
        return int(times.strip("( )times") or 1)

    before = said()

    def dropped() -> bool:
        """Check the drop; press again if a busy machine has dropped them before."""
        flown.evaluate("window.plugged = true")
        fly(pad, {3: -1.0}, lambda joy: joy.axes[0] == 1.0)
        flown.evaluate(script)
        until(lambda: not cockpit.flies)
        pad.seen()
        return said() > before

    until(dropped)
    assert cockpit.joys[-1].axes == (0.0, 0.0, 0.0, 0.0)
    flown.evaluate("window.plugged = true")
    pad.axis(3, 0.0)
    have = len(cockpit.joys)
    pad.seen()
    assert not any(joy.enabled for joy in cockpit.joys[have:]), "held since before: must not count"
    fly(pad)


def test_a_page_that_hangs_is_noticed_by_the_station_and_by_itself(
    flown: Any, cockpit: Cockpit, fly: Any, until: Any, look_at: Any
) -> None:
    pad = Pad(flown)
    fly(pad)
    cockpit.reasons.clear()
    flown.evaluate(
        "() => { const end = performance.now() + 900; while (performance.now() < end); }"
    )
    assert "silent for 0.2 s" in cockpit.reasons
    until(lambda: not cockpit.flies)
    look_at(flown).text("#sticks .note", "this page froze")
    have = len(cockpit.joys)
    pad.seen()
    assert not any(joy.enabled for joy in cockpit.joys[have:])
    fly(pad)


def test_a_closed_page_stops_the_vehicle(
    flown: Any, browser: Any, cockpit: Cockpit, fly: Any, until: Any
) -> None:
    fly(Pad(flown))
    flown.close(run_before_unload=False)
    until(lambda: not cockpit.flies)


def test_sticks_off_centre_at_the_press_are_refused(
    flown: Any, cockpit: Cockpit, fly: Any, until: Any, look_at: Any
) -> None:
    pad, look = Pad(flown), look_at(flown)
    pad.axis(1, 0.4)
    pad.seen()
    pad.button(SHOULDER, True)
    look.text("#sticks .note", "centre all sticks")
    pad.axis(1, 0.0)
    have = len(cockpit.joys)
    pad.seen()
    assert not any(joy.enabled for joy in cockpit.joys[have:]), "centred while held: press again"
    fly(pad)


def test_a_button_held_while_its_pad_is_plugged_in_does_not_count(
    flown: Any, cockpit: Cockpit, fly: Any, look_at: Any
) -> None:
    pad = Pad(flown)
    flown.evaluate("window.plugged = false")
    pad.seen()
    pad.button(SHOULDER, True)
    flown.evaluate("window.plugged = true")
    look_at(flown).text("#sticks .note", "release the button first")
    assert not cockpit.flies
    fly(pad)


def test_the_round_trip_to_the_station_is_shown(
    flown: Any, cockpit: Cockpit, fly: Any, until: Any, look_at: Any
) -> None:
    pad = Pad(flown)
    fly(pad)
    look_at(flown).text("#sticks .trip", r"^[\d.]+ ms, 95 % below [\d.]+ ms$")

    def says_that_nothing_answers() -> bool:
        """Read the note; press again if a busy machine has dropped the sticks."""
        note = str(flown.locator("#sticks .note").text_content())
        if note.startswith("Off"):
            fly(pad)
        return "On, but there is no data from the vehicle" in note

    until(says_that_nothing_answers)


def test_keys_move_their_axis_smoothly_and_only_with_shift(
    flown: Any, cockpit: Cockpit, until: Any
) -> None:
    until(lambda: not cockpit.flies)
    flown.evaluate("document.hasFocus = () => true")
    flown.keyboard.down("w")
    flown.wait_for_timeout(400)
    flown.keyboard.down("Shift")
    have = len(cockpit.joys)
    Pad(flown).seen()
    assert not any(joy.enabled for joy in cockpit.joys[have:]), "a key held since before the press"
    flown.keyboard.up("w")

    def pushed() -> bool:
        """Push full forward and left; press again if a busy machine has dropped the sticks."""
        if not cockpit.flies:
            for key in ("w", "ArrowLeft", "Shift"):
                flown.keyboard.up(key)
            flown.wait_for_timeout(60)
            cockpit.joys.clear()
            flown.keyboard.down("Shift")
            flown.wait_for_timeout(60)
        elif not any(joy.axes[0] for joy in cockpit.joys):
            flown.keyboard.down("w")
            flown.keyboard.down("ArrowLeft")
        return cockpit.flies and cockpit.joys[-1].axes == (1.0, 0.0, 0.0, 1.0)

    until(pushed)
    forward = [joy.axes[0] for joy in cockpit.joys]
    assert max(after - before for before, after in pairwise(forward)) < 0.5, "a full jerk"
    flown.keyboard.up("w")
    flown.keyboard.up("ArrowLeft")
    flown.keyboard.up("Shift")
    until(lambda: not cockpit.flies)
    assert cockpit.joys[-1].axes == (0.0, 0.0, 0.0, 0.0)


def test_a_pad_of_an_unknown_kind_is_set_up_by_moving_it_and_remembered(
    flown: Any, cockpit: Cockpit, fly: Any, until: Any, look_at: Any
) -> None:
    pad, look = Pad(flown, "Radio transmitter (Vendor: 1209)", ""), look_at(flown)
    look.text("#sticks .note", "not known: set it up")
    flown.click("#sticks .foot button:not([hidden])")
    for name, axis, value in (("Forward", 5, -1.0), ("Up", 2, 1.0)):
        flown.click(f'button[aria-label="move the stick for {name}"]')
        look.text("#stick-editor .hint", "Push the stick")
        pad.axis(axis, value)
        look.text("#stick-editor .hint", f"^{name} is set")
        pad.axis(axis, 0.0)
    flown.click('button[aria-label="press the button for Sticks on (hold)"]')
    pad.button(SHOULDER, True)
    look.text("#stick-editor .hint", "is set")
    assert not cockpit.flies, "the button of a pad that is being set up flies nothing"
    pad.button(SHOULDER, False)
    flown.click("#stick-editor >> text=Done")
    bent = pytest.approx((0.7 * 0.5 + 0.3 * 0.5**3, 0.0, 1.0, 0.0), abs=1e-3)
    fly(pad, {5: -0.54, 2: 1.0}, lambda joy: joy.axes == bent)
    flown.reload()
    flown.wait_for_selector("#sticks .note")
    pad = Pad(flown, "Radio transmitter (Vendor: 1209)", "")
    look.text("#sticks .source", "Radio transmitter · own mapping")
    fly(pad)


def test_where_gamepads_need_https_the_page_says_so(
    flown: Any, cockpit: Cockpit, look_at: Any
) -> None:
    flown.evaluate(
        "Object.defineProperty(window, 'isSecureContext', { value: false, configurable: true })"
    )
    look_at(flown).text("#sticks .note", "https or on this computer only")
    flown.evaluate("delete window.isSecureContext")


def test_stick_keys_that_move_the_3d_views_camera_are_said(flown: Any, look_at: Any) -> None:
    flown.evaluate("document.getElementById('scene').focus()")
    look_at(flown).text("#sticks .note", "3D view's camera")
    look_at(flown).text("#emergency-state", "e: emergency land")
    flown.click("#sticks .note")
    look_at(flown).text("#sticks .note", "Hold Shift")


def test_sticks_given_back_after_a_drop_need_one_step_which_is_said(
    context: Any, site: Any, station: Any, flying: Any, look_at: Any
) -> None:
    page = context.new_page()
    page.goto(f"{site.base}/?token={site.token}")
    page.wait_for_selector("#sticks .note")
    page.keyboard.press("Escape")  # the help of a first visit
    pad, look = Pad(page), look_at(page)
    pad.seen()
    station.control("")
    pad.button(SHOULDER, True)
    look.text("#sticks .note", "^On")
    station.control("grace")
    look.text("#sticks .note", "^Off: someone else has control. Ask grace for control.$")
    station.control("")
    again = "Release the button and press it again."
    look.text("#sticks .note", f"^Off: another had control. {again}$")
    pad.axis(3, -1.0)
    look.text("#sticks .note", "Release the button and all sticks, then press it again.$")
    pad.button(SHOULDER, False)
    look.text("#sticks .note", "^Dropped: another had control. Centre all sticks, then press")
    pad.axis(3, 0.0)
    look.text("#sticks .note", "^Dropped: another had control. Press the button again.$")
    pad.button(SHOULDER, True)
    look.text("#sticks .note", "^On")


class _Root(Parameters):
    behavior: BehaviorParameters = BehaviorParameters()


class Flight:
    """Flying vehicle that reports its behavior, on a scripted station."""

    def __init__(self, station: Any) -> None:
        self.station = station
        self.behavior = "hover"
        station.store = ParameterStore(_Root().model_copy(deep=True))
        self._going = threading.Event()
        self._going.set()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while self._going.is_set():
            self.station.fly()
            self.station.put(
                "status",
                new(
                    "quadlab_msgs/VehicleStatus",
                    header=header(1),
                    mode="armed",
                    armed=True,
                    airborne=True,
                    behavior=self.behavior,
                    control_mode="direct",
                    parameter_revision=self.station.store.revision,
                ),
            )
            threading.Event().wait(0.05)

    def stop(self) -> None:
        self._going.clear()
        self._thread.join()


def test_the_panel_says_what_the_sticks_do_and_starts_velocity(
    context: Any, serve: Any, tmp_path: Path, look_at: Any, until: Any
) -> None:
    catalogue = Catalogue(tmp_path)
    with serve(tmp_path, catalogue) as site:
        flight = Flight(site.station)
        page = context.new_page()
        page.goto(f"{site.base}/?token={site.token}")
        look = look_at(page)
        look.text("#sticks .limits", "^Full stick: 1.00 m/s, up 0.50 m/s, turn 57 °/s$")
        page.keyboard.press("Escape")  # the help of a first visit
        Pad(page)
        page.evaluate(PILOT)
        look.text(
            "#sticks .note", "^On, but hover ignores the sticks: start Velocity or Near hover"
        )
        page.click("#sticks > button")
        until(lambda: bool(site.station.requests))
        assert [(s, r.name) for s, r in site.station.requests] == [("start_behavior", "velocity")]
        flight.behavior = "velocity"
        look.text("#sticks .note", "^On: centred, the vehicle hovers")
        page.evaluate("window.wanted = [1, 0, 0, -0.7]")
        look.text("#sticks .note", r"^On: 0\.\d\d m/s forward, 57 °/s turning right\.$")
        look.text("#sticks .trip", "95 % below")
        site.station.requests.clear()
        page.uncheck("#behaviors .behavior:has-text('Near hover') input")
        page.click("#behaviors button:text-is('Near hover')")
        until(lambda: bool(site.station.requests))
        [(_, request)] = site.station.requests
        assert request.name == "near_hovering"
        assert from_parameters(request.arguments) == {"hold_altitude": False}
        flight.behavior = "near_hovering"
        look.text("#sticks .limits", "^Full stick: tilt 12.0°, up 30 % of the weight, turn 57 °/s$")
        look.text("#sticks .note", r"^On: [\d.]+° tilted forward, 57 °/s turning right\.$")
        page.evaluate("window.wanted = [0, 0, 0, 0]")
        look.text("#sticks .note", "^On: centred, level; it may drift")
        flight.stop()
        page.close()
    catalogue.close()
