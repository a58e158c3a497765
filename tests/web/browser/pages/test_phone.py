"""A viewer on a phone: every page is accessible and fits, and the charts are one of the tabs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

WIDTH, HEIGHT = 390, 800
SMALL = ((320, 256), (360, 640))
"""A window of 1280 x 1024 enlarged four times, and a small phone."""
OPEN = "[role=tab][aria-selected=true]"


@pytest.fixture(scope="module")
def phone(chromium: Any, flying_lab: Any) -> Iterator[Any]:
    """Yield a viewer's page; a script's error fails the module."""
    problems: list[str] = []
    with flying_lab.sign_in() as admin, flying_lab.invited(admin, "viewer") as viewer:
        cookies = flying_lab.cookies_of(viewer)
    context = chromium.new_context(viewport={"width": WIDTH, "height": HEIGHT})
    context.set_default_timeout(20_000)
    context.add_cookies(cookies)
    page = context.new_page()
    page.on("pageerror", lambda error: problems.append(f"{error}\n{error.stack}"))
    page.goto(f"{flying_lab.base}/")
    page.wait_for_selector("#who:not(:empty)")
    page.keyboard.press("Escape")  # the help of the first visit
    yield page
    context.close()
    assert problems == []


def out_of_sight(page: Any, *selectors: str) -> list[str]:
    """Return which of them are not wholly in the window when the page is scrolled to its end."""
    page.evaluate("scrollTo(0, document.body.scrollHeight)")
    boxes = {one: page.locator(one).bounding_box() for one in selectors}
    page.evaluate("scrollTo(0, 0)")
    height = page.viewport_size["height"]
    return [one for one, b in boxes.items() if b["y"] < 0 or b["y"] + b["height"] > height]


@pytest.fixture
def console(phone: Any) -> Any:
    phone.set_viewport_size({"width": WIDTH, "height": HEIGHT})
    phone.click("#open-fly")
    return phone


@pytest.mark.parametrize("tab", ["fly", "gains", "tune", "beacons", "link", "charts"])
def test_every_tab_is_accessible_and_within_the_width(
    console: Any, axe_in_both_themes: Any, crooked: Any, tab: str
) -> None:
    console.click(f"#open-{tab}")
    part = "body" if tab == "fly" else f"#tab-{tab}"
    assert axe_in_both_themes(console, part) + crooked(console) == []
    assert out_of_sight(console, "#disarm", "#emergency-land", "#cut") == []


@pytest.mark.parametrize(("width", "height"), SMALL)
def test_state_and_controls_stand_beside_each_other_in_a_small_window(
    console: Any, crooked: Any, width: int, height: int
) -> None:
    console.set_viewport_size({"width": width, "height": height})
    assert crooked(console) == []
    assert out_of_sight(console, "#pill", "#primary", "#emergency-land", "#cut") == []
    shown = ("#pill", "#battery", "#bell", "#disarm", "#primary", "#emergency-land", "#cut")
    boxes = {one: console.locator(one).bounding_box() for one in shown}
    assert all(b["x"] >= 0 and b["x"] + b["width"] <= width for b in boxes.values()), boxes
    covered = [
        (one, other)
        for i, (one, a) in enumerate(boxes.items())
        for other, b in list(boxes.items())[i + 1 :]
        if min(a["x"] + a["width"], b["x"] + b["width"]) > max(a["x"], b["x"])
        and min(a["y"] + a["height"], b["y"] + b["height"]) > max(a["y"], b["y"])
    ]
    assert covered == []


def test_the_guide_fits_and_can_be_closed(console: Any, crooked: Any) -> None:
    console.click("#help")
    assert crooked(console) == []
    console.click("#help-panel button:has-text('Close')")
    assert console.is_hidden("#help-panel")


def test_the_charts_are_a_tab_that_is_reached_by_keyboard_and_draws(
    console: Any, until: Any
) -> None:
    assert console.is_hidden("#charts")
    assert console.is_hidden("#table")
    console.focus("#open-link")
    console.keyboard.press("ArrowRight")
    assert console.get_attribute(OPEN, "id") == "open-charts"
    assert console.is_hidden("#tab-link")
    assert console.is_visible("#table")
    drawn = """() => { const c = document.querySelector('#chart-1 canvas');
      return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((v) => v > 0); }"""
    until(lambda: console.evaluate(drawn))
    boxes = [console.locator(f"#chart-{i}").bounding_box() for i in (0, 1)]
    assert boxes[0]["width"] == boxes[1]["width"] > WIDTH - 10
    assert boxes[0]["height"] > 150
    console.keyboard.press("ArrowRight")
    assert console.get_attribute(OPEN, "id") == "open-fly"
    assert console.is_hidden("#charts")


def test_in_a_wider_window_the_charts_are_in_sight_and_no_tab(console: Any) -> None:
    console.click("#open-charts")
    console.set_viewport_size({"width": 1440, "height": 900})
    console.wait_for_selector("#open-charts", state="hidden")
    assert console.get_attribute(OPEN, "id") == "open-fly"
    assert console.is_visible("#tab-fly")
    console.click("#open-link")
    assert console.is_visible("#charts")
    assert console.is_visible("#table")
    console.set_viewport_size({"width": WIDTH, "height": HEIGHT})
    console.wait_for_selector("#charts", state="hidden")
    assert console.is_visible("#tab-link")


@pytest.mark.parametrize(
    ("path", "ready"),
    [
        ("/runs", "#list tr[data-index]"),
        ("/setup", "#checks li"),
        ("/replay/{run}", "main[data-shown]"),
        ("/kill", "#cut"),
    ],
)
def test_every_other_page_is_accessible_and_within_the_width(
    phone: Any,
    flying_lab: Any,
    lab_of_pages: Any,
    axe_in_both_themes: Any,
    crooked: Any,
    path: str,
    ready: str,
) -> None:
    phone.set_viewport_size({"width": WIDTH, "height": HEIGHT})
    phone.goto(f"{flying_lab.base}{path.format(run=lab_of_pages.RUN)}")
    phone.wait_for_selector(ready)
    assert axe_in_both_themes(phone) + crooked(phone) == []
    assert out_of_sight(phone, "#emergency-land", "#cut") == []
