"""Sliders: they show only confirmed values, and never jump while dragged."""

from __future__ import annotations

from typing import Any

KP = ".gain:has(input[aria-label='gains.kp'])"
CELL = f"{KP} input.value"


def open_gains(page: Any) -> None:
    page.click("[data-tab=gains]")
    page.click("#gains summary")
    page.wait_for_selector(f"{KP} input[type=range]", state="visible")


def slide(page: Any, value: float) -> None:
    page.locator(f"{KP} input[type=range]").evaluate(
        "(slider, value) => { slider.value = value; slider.dispatchEvent(new Event('input')); }",
        value,
    )


def value_of(page: Any) -> str:
    return str(page.locator(f"{KP} input.value").input_value())


def test_a_slider_changes_the_vehicle_and_every_page_follows(
    site: Any, page: Any, look: Any, look_at: Any, open_page: Any
) -> None:
    other = open_page(site)
    page.wait_for_selector("#gains .gain", state="attached")
    assert page.locator("#gains .gain input").count() == 0, "rows are drawn when they are shown"
    for one in (page, other):
        open_gains(one)
    look.text("#gains .absent", "^simulator not there: .* for a simulated vehicle only$")
    slide(page, 6.2)
    for one in (page, other):
        look_at(one).value(CELL, "6.2")
        assert one.locator(f"{KP} input[type=range]").input_value() == "6.2"
    look.has_class(KP, "changed")
    page.click(f"{KP} .mark")
    look.value(CELL, "4")
    other.close()


def test_a_cell_shows_only_what_is_confirmed_and_a_late_one_is_amber(
    page: Any, look: Any, station: Any
) -> None:
    open_gains(page)
    before = value_of(page)
    station.answering.clear()
    slide(page, 12.5)
    look.has_class(KP, "waiting|late")
    assert value_of(page) == before
    look.has_class(KP, "late")
    assert value_of(page) == before
    assert page.locator(f"{KP} input[type=range]").input_value() == before
    station.answering.set()
    look.value(CELL, "12.5")
    slide(page, float(before))


def test_a_refused_value_shows_its_reason_and_reverts(page: Any, look: Any, station: Any) -> None:
    open_gains(page)
    before = value_of(page)
    station.refusal = "gains.kp: the step is too large in flight"
    slide(page, 15.0)
    look.text(f"{KP} .reason", "the step is too large in flight")
    assert value_of(page) == before
    assert page.locator(f"{KP} input[type=range]").input_value() == before


def press(page: Any, *types: str) -> None:
    for kind in types:
        page.locator(f"{KP} input[type=range]").evaluate(
            "(slider, kind) => slider.dispatchEvent(new Event(kind))", kind
        )


def test_one_press_on_a_slider_is_one_change_however_long_it_lasts(
    page: Any, look: Any, station: Any
) -> None:
    open_gains(page)
    press(page, "pointerdown")
    for value in (6.0, 9.5, 13.5):
        slide(page, value)
        look.value(CELL, f"{value:g}")
        # Longer than between two presses of a key, and than between two lines of events.
        page.evaluate(
            "() => { const now = performance.now.bind(performance); "
            "performance.now = () => now() + 4000; }"
        )
    press(page, "pointerup")
    press(page, "pointerdown")
    slide(page, 14.0)
    look.value(CELL, "14")
    press(page, "pointerup")
    assert "gains.kp back to 13.5" in str(page.get_attribute("#undo", "title"))
    page.click("#undo")
    look.value(CELL, "13.5")
    assert "gains.kp back to 4" in str(page.get_attribute("#undo", "title"))
    page.evaluate(
        "() => document.body.dispatchEvent(new KeyboardEvent('keydown', "
        "{ key: 'z', ctrlKey: true, bubbles: true }))"
    )
    look.value(CELL, "4")
    assert page.is_disabled("#undo")
    look.text("#events li:first-child", "gains.kp 4 → 4 \\(6 values\\)")
    values = page.get_attribute("#events li:first-child", "title")
    assert values == "4 → 6 → 9.5 → 13.5 → 14 → 13.5 → 4"
