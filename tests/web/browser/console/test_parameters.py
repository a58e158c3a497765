"""Gains tab in Chromium: one and a second operator, presets, files, earlier values."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

DEFAULTS = {"gains.kp": 4.0, "gains.laps": 3, "gains.exact": False, "gains.rate": "nominal"}
KP = ".gain:has(input[aria-label='gains.kp'])"
SLIDER, CELL, TICK = f"{KP} input[type=range]", f"{KP} input.value", f"{KP} .confirmed"


@pytest.fixture(scope="module")
def console(kept_context: Any, site: Any) -> Iterator[Any]:
    """Yield one page for all tests here, of a vehicle that publishes; its scripts may not fail."""
    going, problems = threading.Event(), []
    going.set()

    def fly() -> None:
        while going.is_set():
            site.station.fly()
            threading.Event().wait(0.02)

    thread = threading.Thread(target=fly, daemon=True)
    thread.start()
    page = kept_context.new_page()
    page.on("pageerror", lambda error: problems.append(f"{error}\n{error.stack}"))
    page.goto(f"{site.base}/?token={site.token}")
    page.wait_for_selector("#behaviors button")
    yield page
    page.close()
    going.clear()
    thread.join()
    assert problems == []


@pytest.fixture
def gains(console: Any, station: Any) -> Iterator[Any]:
    """Yield the Gains tab with its tree open and all values at their defaults."""
    console.click("[data-tab=gains]")
    if console.locator("#parameter-views [aria-pressed=true]").count():
        console.click("#parameter-views [aria-pressed=true]")
    console.wait_for_selector("#gains summary")
    console.evaluate("document.querySelectorAll('#gains details').forEach((d) => (d.open = true))")
    console.wait_for_selector(SLIDER, state="visible")
    yield console
    change(console, DEFAULTS)


@pytest.fixture
def look(gains: Any, look_at: Any) -> Any:
    return look_at(gains)


def change(page: Any, values: dict[str, Any]) -> None:
    """Change a parameter as another page of the same person would."""
    page.evaluate(
        "(values) => fetch('/api/parameters', { method: 'PUT', body: JSON.stringify({ values }),"
        " headers: { 'Content-Type': 'application/json' } })",
        values,
    )


def thumb(page: Any) -> str:
    return str(page.locator(SLIDER).input_value())


def test_the_thumb_stays_with_the_hand_and_goes_to_the_truth_when_let_go(
    gains: Any, look: Any, station: Any
) -> None:
    slider = gains.locator(SLIDER)
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    x, y, width = box["x"], box["y"] + box["height"] / 2, box["width"]
    gains.mouse.move(x + 0.2 * width, y)
    gains.mouse.down()
    gains.mouse.move(x + 0.5 * width, y, steps=4)
    held = thumb(gains)
    look.value(CELL, held)
    change(gains, {"gains.kp": 17.0})  # the other operator
    look.value(CELL, "17")
    assert thumb(gains) == held, "the hand keeps the thumb"
    assert gains.locator(TICK).is_visible(), "the confirmed value has a mark of its own"
    gains.mouse.up()
    look.value(SLIDER, "17")
    assert not gains.locator(TICK).is_visible()

    # By keyboard: on the slider, and in the cell.
    slider.focus()
    slider.press("ArrowLeft")
    look.value(CELL, "16.9")
    gains.locator(CELL).focus()
    gains.locator(CELL).press("ArrowUp")
    look.value(CELL, "17")
    gains.locator(CELL).press("PageDown")
    look.value(CELL, "16")
    look.value(SLIDER, "16")


def test_a_refused_step_in_flight_can_be_walked(gains: Any, look: Any, station: Any) -> None:
    # The scripted station has no steps: the page only has to offer them.
    offered = gains.evaluate(
        """async () => {
          const { GainRow } = await import("/static/gains/row.js");
          const description = { name: "a.b", type: "float", default: 4, value: 4, description: "",
            unit: "", minimum: 0, maximum: 20, step: 1, read_only: false, choices: [],
            flight_step: 4 };
          const asked = [];
          const row = new GainRow(description, true, async (value, walks) => {
            asked.push([value, walks]);
            if (!walks) throw new Error("a.b = 15 is too far from 4 in flight");
            row.confirm(value);
          }, () => {});
          row.fill();
          const turn = () => new Promise((resolve) => setTimeout(resolve));
          const settled = async () => { while (row.sender.busy) await turn(); };
          row.enter("15");
          await settled();
          const offer = row.reason.querySelector("button");
          const text = offer.textContent;
          offer.click();
          await settled();
          return [text, asked, row.box.value];
        }"""
    )
    assert offered == ["Apply in 3 steps", [[15, False], [15, True]], "15"]
