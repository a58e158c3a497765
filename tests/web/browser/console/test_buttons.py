"""Buttons that have to be held, and buttons that make the vehicle fly, in Chromium."""

from __future__ import annotations

from typing import Any

import pytest

from control.behaviors.demands import Preview

HELD = ("#arm", "#cut", "#tab-calibrate button:text-is('Start')")


STANDS = {"mode": "ready", "armed": False, "airborne": False, "behavior": "ground"}


def asked(station: Any) -> list[str]:
    return [getattr(request, "name", service) for service, request in station.requests]


@pytest.fixture
def console(kept_page: Any, flying: Any) -> Any:
    """Return a page whose charts run, and whose help of a first visit is closed."""
    kept_page.keyboard.press("Escape")
    return kept_page


@pytest.fixture
def look(console: Any, look_at: Any) -> Any:
    return look_at(console)


def test_what_must_be_held_says_so(console: Any) -> None:
    for button in HELD:
        told = console.locator(button).evaluate("one => getComputedStyle(one, '::before').content")
        assert told.startswith('"hold"'), button
    plain = console.locator("#take-off").evaluate(
        "one => getComputedStyle(one, '::before').content"
    )
    assert "hold" not in plain


@pytest.mark.parametrize("press", ["pointer", "key"])
def test_a_short_press_says_to_keep_holding_and_does_nothing(
    console: Any, station: Any, look: Any, press: str
) -> None:
    station.said = STANDS
    console.wait_for_selector("#arm:enabled")
    console.wait_for_selector("#primary:not([data-new])")
    if press == "pointer":
        console.click("#arm")
    else:
        console.press("#arm", "Enter")
    look.text("#hold-hint", "^keep holding, 0.8 s$")
    hint, button = (console.locator(one).bounding_box() for one in ("#hold-hint", "#arm"))
    assert hint["y"] >= button["y"] + button["height"]
    assert abs(hint["x"] + hint["width"] / 2 - button["x"] - button["width"] / 2) < 60.0
    assert asked(station) == []
    look.text("#hold-hint", "^$")  # it disappears by itself


def test_space_pauses_the_charts_and_does_not_start_the_focused_behavior_again(
    console: Any, station: Any, look: Any, until: Any
) -> None:
    hover = "#behaviors button:text-is('Hover')"
    console.click(hover)
    until(lambda: asked(station) == ["hover"])
    assert console.evaluate("document.activeElement.textContent") == "Hover"
    console.keyboard.press(" ")
    look.text("#charts .bar button >> nth=0", "^Resume$")
    console.keyboard.press(" ")
    look.text("#charts .bar button >> nth=0", "^Pause$")
    assert asked(station) == ["hover"]
    console.keyboard.press("Enter")  # keyboard users press it so
    until(lambda: asked(station) == ["hover", "hover"])


@pytest.mark.parametrize("button", ["#take-off", "#land", "#emergency-land", "#sticks > button"])
def test_the_space_bar_starts_no_flight(console: Any, station: Any, look: Any, button: str) -> None:
    station.said = STANDS | {"mode": "armed", "armed": True} if button == "#take-off" else {}
    console.wait_for_selector(f"{button}:enabled")
    console.wait_for_selector("#primary:not([data-new])")
    console.focus(button)
    console.keyboard.press(" ")
    look.text("#charts .bar button >> nth=0", "^Resume$")
    console.keyboard.press(" ")
    look.text("#charts .bar button >> nth=0", "^Pause$")
    assert asked(station) == []


def test_a_trajectory_tells_what_it_asks_before_it_starts(
    console: Any, look: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = Preview([(0.0, 0.0, 1.0), (1.0, 0.0, 1.0)], 19.2, 0.634, "")
    laps: list[int] = []

    def compute(_: Any, here: Any, arguments: Any, *more: Any) -> Preview:
        laps.append(arguments["laps"])
        return found

    monkeypatch.setattr("web.commands.previewer.Previewer.compute", compute)
    row = "#behaviors .behavior:has(button:text-is('Circle'))"
    console.hover(row)
    look.text("#plan", "^Circle: 00:19, up to 0.63 m/s; the vehicle can fly it.$")
    console.wait_for_selector("#planned-key")
    found = Preview(found.points, 5.0, 3.0, "follow_trajectory refused: too quick; try slower")
    console.fill(f"{row} input >> nth=0", "2")
    look.text("#plan", "^Circle: too quick; try slower$")
    assert laps == [3, 2]
