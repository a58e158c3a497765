"""The page in Chromium with a blank 3D view: what a person sees and does."""

from __future__ import annotations

from typing import Any

import pytest

STANDS = {"airborne": False, "behavior": "ground"}
"""Status of a vehicle that is armed on the ground."""


@pytest.fixture
def shown(kept_page: Any, flying: Any) -> Any:
    """Return a page for tests that change only what the vehicle says."""
    return kept_page


@pytest.fixture
def seen(shown: Any, look_at: Any) -> Any:
    return look_at(shown)


def test_a_simulation_that_is_slowed_says_so_and_moves_nothing(
    shown: Any, seen: Any, station: Any
) -> None:
    seen.text("#doing", "^FLYING")
    shown.wait_for_selector("#pace", state="hidden")  # a real vehicle
    station.real_time_factor = 0.99
    seen.text("#factor", "^0.99× real time$")
    assert shown.is_hidden("#pace")

    def places() -> list[Any]:
        ids = ("recording", "tracker", "battery", "primary", "pill")
        return [shown.locator(f"#{name}").bounding_box()["x"] for name in ids]

    before = places()
    station.real_time_factor = 0.634
    seen.text("#factor", "^0.63× real time$")
    shown.wait_for_selector("#pace", state="visible")
    assert places() == pytest.approx(before, abs=2.0)
    seen.has_no_class("#factor", "warn|alarm")


def test_arming_needs_a_hold_and_a_click_does_nothing(
    page: Any, look: Any, station: Any, until: Any
) -> None:
    station.said = {**STANDS, "mode": "ready", "armed": False}
    page.wait_for_selector("#arm:enabled")
    assert page.is_hidden("#disarm")
    page.click("#arm")
    page.click("#emergency-land")
    until(lambda: bool(station.requests))
    assert [name for name, _ in station.requests] == ["emergency"]
    station.said = STANDS
    for button in ("#arm", "#disarm"):
        station.said = STANDS if button == "#disarm" else {**STANDS, "mode": "cut", "armed": False}
        page.wait_for_selector(f"{button}:enabled")
        page.wait_for_selector("#primary:not([data-new])")
        if button == "#arm":
            look.text(button, "^Disarm$")  # the page may still show the motors off
        count = len(station.requests)
        look.hold(button, lambda count=count: len(station.requests) > count)
        assert station.requests[-1][0] == "disarm"


def test_the_button_of_the_moment_leads_from_arming_to_landing_in_one_place(
    page: Any, look: Any, station: Any, until: Any
) -> None:
    page.keyboard.press("Escape")  # the help of a first visit
    shown = """[...document.querySelectorAll('#primary > button')]
      .filter((one) => getComputedStyle(one).visibility === 'visible').map(({ id }) => id).join()"""
    boxes = set()
    for said, pill, button in (
        ({**STANDS, "mode": "ready", "armed": False}, "^MOTORS OFF$", "arm"),
        (STANDS, "^ARMED$", "take-off"),
        ({"behavior": "take_off"}, r"^FLYING 00:0\d$", "land"),
        ({"behavior": "hover"}, r"^FLYING 00:\d\d$", "land"),
        ({"behavior": "land"}, "^LANDING$", "land"),
    ):
        station.said = said
        look.text("#doing", pill)
        assert page.evaluate(shown) == button
        boxes.add(tuple(page.locator(f"#{button}").bounding_box().values()))
        page.evaluate("Date.now = () => 0")  # the computer's clock was set
    assert len(boxes) == 1
    look.text("#in-words", r"^Landing at 1\.00 m.* mm error, not real time|^Landing at 1\.\d\d m")


def test_a_second_click_does_not_hit_the_button_that_came_instead(
    page: Any, look: Any, station: Any, until: Any
) -> None:
    page.keyboard.press("Escape")
    station.said = STANDS
    page.wait_for_selector("#take-off", state="visible")
    page.wait_for_selector("#primary:not([data-new])")
    page.evaluate("document.getElementById('take-off').focus()")
    page.evaluate(  # the second click comes with the button, however slow the computer is
        """() => new MutationObserver((_, observer) => {
            observer.disconnect();
            document.getElementById("land").click();
        }).observe(document.getElementById("primary"), { attributeFilter: ["data-new"] })"""
    )
    station.said = {"behavior": "take_off"}
    page.wait_for_selector("#land", state="visible")
    assert page.evaluate("document.activeElement.id") == "land"
    page.wait_for_selector("#primary:not([data-new])")
    assert station.requests == []
    page.click("#land")
    until(lambda: [request.name for _, request in station.requests] == ["land"])


def test_land_and_cut_are_two_emergencies(page: Any, look: Any, station: Any, until: Any) -> None:
    page.click("#emergency-land")
    until(lambda: len(station.requests) == 1)
    look.hold("#cut", lambda: len(station.requests) == 2)
    assert [request.action for _, request in station.requests] == ["land", "cut"]


def test_charts_draw_the_signals_that_were_chosen(page: Any, look: Any, until: Any) -> None:
    page.click("#chart-1 button")
    page.fill("#chart-1 .menu input[type=search]", "kg")
    page.click("#chart-1 .menu label:text-is('mass') input")
    page.keyboard.press("Escape")
    look.text("#chart-1 .legend", "mass")
    look.text("#chart-1 .legend span:has-text('mass') output", r"^1\.310$")
    drawn = """() => { const c = document.querySelector('#chart-0 canvas');
      return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((v) => v > 0); }"""
    until(lambda: page.evaluate(drawn))


def test_the_emergency_page_has_no_webgl_and_two_buttons(
    site: Any, page: Any, look: Any, station: Any, until: Any
) -> None:
    page.goto(f"{site.base}/kill")
    look.text("#state", "armed, hover")
    assert page.locator("iframe, canvas").count() == 0
    page.click("#cut")
    look.text("#answer", "accepted, not yet shown by the vehicle")
    until(lambda: [request.action for _, request in station.requests] == ["cut"])
