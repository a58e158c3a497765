"""The formation on the page of the fleet, in Chromium."""

from __future__ import annotations

from typing import Any

import pytest

REFUSED = "the battery is low"


@pytest.fixture
def page(fleet: Any, chromium: Any) -> Any:
    """Yield the page of a fleet of which the first vehicle flies and the others stand."""
    first, *others = fleet.stations
    first.said = {"behavior": "hover"}
    for station in others:
        station.said = {"armed": False, "airborne": False, "behavior": "ground"}
    for station in fleet.stations:
        station.requests.clear()
        station.refusal = ""
    with fleet.sign_in() as admin:
        context = chromium.new_context(viewport={"width": 1400, "height": 900})
        context.add_cookies(fleet.cookies_of(admin))
        page = context.new_page()
        problems: list[str] = []
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(f"{fleet.base}/fleet")
        yield page
        context.close()
        assert problems == []


def test_an_order_ends_where_a_vehicle_refuses_and_others_keep_their_turn(
    fleet: Any, page: Any, look: Any
) -> None:
    fleet.stations[1].refusal = REFUSED
    look.text("#formation .summary", "No vehicle flies velocity yet")
    page.get_by_role("button", name="Take off in order").click()
    look.text("#formation .said", f"⚠ quad2: {REFUSED}")
    asked = [[service for service, _ in one.requests] for one in fleet.stations]
    assert asked == [[], ["arm"], []]


def test_held_sticks_say_what_is_missing_and_leave_the_emergency_free(
    fleet: Any, page: Any, look: Any
) -> None:
    look.text("#formation .summary", "No vehicle flies velocity yet")
    page.keyboard.down("Shift")
    look.text("#formation .steering .note", "^Off: ")  # held since before the page read it, perhaps
    page.keyboard.up("Shift")
    look.text("#formation .steering .note", "^(Hold Shift: |Dropped: .* Press the button again)")
    page.keyboard.down("Shift")
    look.text("#formation .steering .note", "Off: 0 of at least 3 vehicles fly velocity")
    look.hold(
        "#emergency-land-all",
        lambda: any(service == "emergency" for service, _ in fleet.stations[0].requests),
    )
    page.keyboard.up("Shift")
