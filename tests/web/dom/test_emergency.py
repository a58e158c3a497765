"""Emergency controls: two gestures, and no success shown before the vehicle's."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from vehicle_link.messages import header, new


def show(station: Any, mode: str) -> None:
    station.put("status", new("quadlab_msgs/VehicleStatus", header=header(1), mode=mode))


def actions(station: Any) -> list[str]:
    return [request.action for name, request in station.requests if name == "emergency"]


@pytest.fixture
def still(kept_page: Any, station: Any) -> Any:
    """Return a page whose vehicle publishes only what the test requests."""
    show(station, "armed")
    kept_page.keyboard.press("Escape")  # the help of a first visit
    return kept_page


@pytest.fixture
def fresh(open_page: Any, site: Any, station: Any) -> Any:
    """Return such a page for a test that leaves it or changes it."""
    show(station, "armed")
    page = open_page(site)
    page.keyboard.press("Escape")
    return page


def test_a_press_stays_in_sight_until_the_vehicle_shows_it(
    still: Any, station: Any, look_at: Any
) -> None:
    look = look_at(still)
    station.answering.clear()
    still.click("#emergency-land")
    look.text("#emergency-state", r"^Emergency land: not acknowledged.*, sent [\d.]+ s ago$")
    look.has_class("#emergency-state", "waiting")
    station.answering.set()
    look.text("#emergency-state", "accepted, not yet shown by the vehicle")
    show(station, "emergency_land")
    look.text("#emergency-state", r"^landing, acknowledged after [\d.]+ s$")
    look.has_class("#emergency-state", "done")
    assert actions(station) == ["land"]


def test_every_page_sees_who_pressed_and_a_page_that_comes_later_too(
    still: Any, station: Any, site: Any, look_at: Any, operator: Any
) -> None:
    label = operator.get("/api/session").json()["label"]
    operator.post("/api/commands/emergency", json={"action": "cut"})
    look_at(still).text("#emergency-state", f"^Cut motors by {label}: accepted, not yet")
    later = still.context.new_page()
    later.goto(site.base)
    look_at(later).text("#emergency-state", f"^Cut motors by {label}: accepted, not yet")
    show(station, "cut")
    for page in (still, later):
        look_at(page).text("#emergency-state", f"^motors cut by {label}, acknowledged after")
    later.close()


def test_a_refusal_and_a_missing_vehicle_are_said_with_their_reason(
    still: Any, station: Any, look_at: Any
) -> None:
    look = look_at(still)
    station.refusal = "emergency land refused: the motors are off"
    still.keyboard.press("e")
    look.text("#emergency-state", "failed: emergency land refused: the motors are off")
    look.has_class("#emergency-state", "failed")
    station.refusal, station.away = "", True
    still.keyboard.press("e")
    look.text("#emergency-state", "not acknowledged, try 2 of 3")
    look.text("#emergency-state", "failed: the base station cannot be reached")


def test_cut_is_held_and_its_key_too(still: Any, station: Any, until: Any) -> None:
    still.click("#cut")
    still.keyboard.press("x")
    still.keyboard.press("e")
    until(lambda: actions(station) == ["land"])
    still.keyboard.down("Shift")  # as when flying by keyboard
    still.keyboard.down("x")
    until(lambda: actions(station) == ["land", "cut"])
    still.keyboard.up("x")
    still.keyboard.up("Shift")
    show(station, "cut")


def test_how_long_a_key_was_held_counts_also_on_a_page_whose_timers_are_late(
    still: Any, station: Any, until: Any
) -> None:
    def hold(milliseconds: int) -> None:
        still.evaluate(
            """(milliseconds) => {
            const send = (type) => document.dispatchEvent(new KeyboardEvent(type, { key: 'x' }));
            const end = performance.now() + milliseconds;
            send('keydown');
            while (performance.now() < end);
            send('keyup'); }""",
            milliseconds,
        )

    hold(300)
    still.keyboard.press("e")
    until(lambda: actions(station) == ["land"])
    hold(600)
    until(lambda: actions(station) == ["land", "cut"])


def test_the_pads_buttons_land_at_a_press_and_cut_when_held(
    fresh: Any, station: Any, until: Any
) -> None:
    fresh.evaluate(
        """() => { window.pad = { id: 'x', mapping: 'standard', connected: true,
        axes: [0, 0, 0, 0], buttons: Array.from({ length: 17 }, () => ({ pressed: false })) };
        window.pad.buttons[1].pressed = true;
        navigator.getGamepads = () => { window.looked?.(); return [window.pad]; }; }"""
    )

    def press(button: int, pressed: bool) -> None:
        fresh.evaluate(
            """([button, pressed]) => { window.pad.buttons[button].pressed = pressed;
            let looks = 0; // at the second the first has been acted upon
            return new Promise((done) => { window.looked = () => { if (++looks > 1) done(); }; });
            }""",
            [button, pressed],
        )

    press(8, False)
    assert actions(station) == [], "held since before the page saw the pad"
    press(1, False)
    press(1, True)
    until(lambda: actions(station) == ["land"])
    press(8, True)
    press(8, False)
    press(8, True)
    until(lambda: actions(station) == ["land", "cut"])


def test_a_viewer_may_land_but_not_cut(
    site: Any, station: Any, viewer: Any, context: Any, until: Any
) -> None:
    name, value = next(iter(viewer.cookies.items()))
    context.add_cookies([{"name": name, "value": value, "url": site.base}])
    page = context.new_page()
    page.goto(site.base)
    page.click("#emergency-land")
    until(lambda: actions(station) == ["land"])
    assert page.is_disabled("#cut")


@pytest.mark.parametrize("path", ["/runs", "/setup"])
def test_the_pages_beside_the_console_have_both_controls(
    site: Any, fresh: Any, station: Any, until: Any, look_at: Any, path: str
) -> None:
    assert fresh.goto(f"{site.base}{path}").status == 200
    fresh.wait_for_selector("#head-controls #cut")
    fresh.keyboard.press("e")
    until(lambda: actions(station) == ["land"])
    look_at(fresh).text("#emergency-state", "accepted, not yet shown")


@pytest.fixture
def timeless(serve: Any, tmp_path: Path, open_page: Any) -> Iterator[tuple[Any, Any]]:
    """Yield a page whose timers are stopped, and the station of a process of its own.

    `window.drawn` receives the type of each event with the emergency's line right after it.
    """
    with serve(tmp_path, Catalogue(tmp_path)) as own:
        page = open_page(own)
        page.keyboard.press("Escape")  # the help of a first visit
        page.wait_for_selector("#emergency-state")
        page.evaluate(
            """() => { for (let k = setInterval(() => {}); k > 0; k--) clearInterval(k);
            const { dispatchEvent } = EventTarget.prototype;
            window.drawn = [];
            EventTarget.prototype.dispatchEvent = function watched(event) {
              const answer = dispatchEvent.call(this, event);
              const line = document.querySelector("#emergency-state").textContent;
              if (["emergency", "summary"].includes(event.type))
                window.drawn.push([event.type, event.detail.press?.phase ?? "", line]);
              return answer; }; }"""
        )
        yield page, own.station


def test_the_answer_is_drawn_with_its_event_and_waits_for_no_timer(
    timeless: tuple[Any, Any], look_at: Any
) -> None:
    page, station = timeless
    show(station, "armed")
    page.click("#emergency-land")
    look_at(page).text("#emergency-state", "accepted, not yet shown by the vehicle")
    show(station, "emergency_land")
    look_at(page).has_class("#emergency-state", "done")
    drawn = page.evaluate("() => window.drawn.filter(([type]) => type === 'emergency')")
    words = {"sent": "not acknowledged", "accepted": "not yet shown", "acknowledged": " after "}
    assert {phase for _, phase, _ in drawn} == set(words)
    assert [line for _, phase, line in drawn if words[phase] not in line] == []


def test_a_landing_that_nobody_pressed_is_drawn_with_the_status_that_shows_it(
    timeless: tuple[Any, Any], look_at: Any
) -> None:
    page, station = timeless
    station.put(
        "status",
        new("quadlab_msgs/VehicleStatus", header=header(1), mode="emergency_land", airborne=True),
    )
    look_at(page).text("#emergency-state", "^landing under control; only Cut is obeyed$")
    assert page.evaluate("() => window.drawn.filter(([type]) => type === 'emergency')") == []
