"""Commanding by hand: drafts of the 3D view, and sticks under the fingers of a phone."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from control.behaviors.demands import Preview
from control.behaviors.parameters import BehaviorParameters
from quadrotor.errors import RefusedError
from quadrotor.parameters import Parameters, ParameterStore

HOVERS = {"mode": "armed", "armed": True, "airborne": True, "behavior": "hover"}


class _Root(Parameters):
    behavior: BehaviorParameters = BehaviorParameters()


@pytest.fixture(scope="module")
def phone(chromium: Any, site: Any) -> Iterator[Any]:
    site.station.store = ParameterStore(_Root().model_copy(deep=True))
    context = chromium.new_context(viewport={"width": 390, "height": 844}, has_touch=True)
    page = context.new_page()
    page.goto(f"{site.base}/?token={site.token}")
    page.wait_for_selector("#behaviors button")
    page.keyboard.press("Escape")  # the help of a first visit
    yield page
    context.close()


def test_a_target_is_flown_to_by_its_button_alone_and_not_where_it_cannot(
    phone: Any, look_at: Any, station: Any, flying: Any, until: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    station.said = HOVERS
    x_max = 3.0

    def compute(_: Any, here: Any, arguments: Any, *more: Any) -> Preview:
        if arguments["x"] > x_max:
            raise RefusedError("follow_trajectory refused: outside the flight volume")
        return Preview([(0.0, 0.0, 1.0), (1.0, 0.0, 1.0)], 2.5, 0.8, "")

    monkeypatch.setattr("web.commands.previewer.Previewer.compute", compute)
    look = look_at(phone)
    if phone.is_visible("#draft"):  # of a run before
        phone.tap("#draft button:has-text('Cancel')")
    phone.tap("#draw button:has-text('Target')")
    look.text("#draft b", r"^Target [\d.−-]+, [\d.−-]+, 1.00 m$")
    look.text("#draft [role=status]", "^00:0[23], up to 0.80 m/s$")
    assert station.requests == [], "nothing is commanded before the press"
    phone.tap("#draft .go:enabled")
    until(lambda: len(station.requests) == 1)
    service, request = station.requests[0]
    assert (service, request.name) == ("start_behavior", "fly_to")
    phone.wait_for_selector("#draft", state="hidden")
    x_max = -3.0
    phone.tap("#draw button:has-text('Target')")
    look.text("#draft [role=status]", "^outside the flight volume$")
    assert phone.is_disabled("#draft .go")
    phone.keyboard.press("Escape")
    phone.wait_for_selector("#draft", state="hidden")
    assert len(station.requests) == 1


def test_a_finger_on_a_pad_is_the_stick_and_its_lift_or_cancelling_the_brake(
    phone: Any, station: Any, flying: Any, until: Any
) -> None:
    station.said = HOVERS | {"behavior": "velocity"}
    phone.evaluate("document.hasFocus = () => true")
    phone.tap("button:text-is('Touch sticks')")
    pad = phone.locator(".touch-pad").nth(1).bounding_box()
    x, y = pad["x"] + 67, pad["y"] + 67
    devtools = phone.context.new_cdp_session(phone)

    def touch(kind: str, *places: tuple[float, float]) -> None:
        points = [{"x": x, "y": y, "id": 1} for x, y in places]
        devtools.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", (x, y))
    until(lambda: (phone.wait_for_timeout(20), ((0.0,) * 4, True) in station.sticks)[1])
    touch("touchMove", (x + 80, y - 28))
    until(lambda: (phone.wait_for_timeout(20), station.sticks[-1][0][1] == -1.0)[1])
    forward, left, up, yaw = station.sticks[-1][0]
    assert 0.2 < forward < 0.6
    assert (left, up, yaw) == (-1.0, 0.0, 0.0)
    touch("touchEnd")
    until(lambda: (phone.wait_for_timeout(20), station.sticks[-1] == ((0.0,) * 4, False))[1])
    touch("touchStart", (x, y))
    until(lambda: (phone.wait_for_timeout(20), station.sticks[-1] == ((0.0,) * 4, True))[1])
    touch("touchCancel")  # by the system: a call, a gesture
    until(lambda: (phone.wait_for_timeout(20), station.sticks[-1] == ((0.0,) * 4, False))[1])
    phone.tap("#touch button:has-text('Close')")


def test_a_keep_out_box_is_set_and_taken_away_by_its_buttons(
    phone: Any, look_at: Any, station: Any, flying: Any, until: Any
) -> None:
    station.said = HOVERS
    look = look_at(phone)

    def press(words: str) -> str:
        asked = len(station.requests)
        phone.tap(f"#draft button:text-is('{words}'):enabled")
        until(lambda: len(station.requests) > asked)
        service, request = station.requests[-1]
        phone.wait_for_selector("#draft", state="hidden")
        [one] = request.parameters
        assert (service, one.name) == ("change_parameters", "behavior.keep_out")
        return str(one.value.string_value)

    phone.tap("#draw button:has-text('Keep-out')")
    look.text("#draft b", r"^box_1 x [\d.−]+ to [\d.−]+, y .*, z 0.00 to 1.00 m$")
    assert station.requests == [], "nothing is sent before the press"
    assert press("Set box").startswith("box_1 ")
    phone.tap("#draw button:has-text('Keep-out')")
    look.text("#draft b", "^box_2 ")
    phone.select_option("#draft [aria-label='keep-out box']", "box_1")
    look.text("#draft b", "^box_1 ")
    assert press("Remove") == "none"
