"""Light and dark theme: the system's, or the one chosen by hand, on every page."""

from __future__ import annotations

from typing import Any

import pytest

CHOICE = "#help-panel .theme select"


def shade(page: Any) -> str:
    """Return light or dark: the opposite of the page's text."""
    red = int(page.evaluate("getComputedStyle(document.body).color").split("(")[1].split(",")[0])
    return "dark" if red > 128 else "light"


@pytest.fixture
def console(page: Any) -> Any:
    page.keyboard.press("Escape")  # the help of the first visit
    yield page
    page.emulate_media(color_scheme="dark")


def choose(page: Any, choice: str) -> None:
    page.click("#help")
    page.select_option(CHOICE, choice)
    page.keyboard.press("Escape")


def test_the_page_follows_the_system_until_a_theme_is_chosen(console: Any) -> None:
    for scheme in ("light", "dark", "light"):
        console.emulate_media(color_scheme=scheme)
        assert shade(console) == scheme
    choose(console, "dark")
    assert shade(console) == "dark"
    choose(console, "")
    assert shade(console) == "light"


def test_the_choice_is_kept_and_counts_on_pages_without_scripts(console: Any, site: Any) -> None:
    console.emulate_media(color_scheme="light")
    console.goto(f"{site.base}/kill")
    assert shade(console) == "light"
    console.emulate_media(color_scheme="dark")
    console.goto(f"{site.base}/")
    console.wait_for_selector("#behaviors button")
    console.keyboard.press("Escape")
    choose(console, "light")
    console.reload()
    assert console.evaluate("document.documentElement.dataset.theme") == "light"
    for path in ("runs", "setup", "kill", "emergency", "login"):
        console.goto(f"{site.base}/{path}")
        assert shade(console) == "light", path
    console.goto(f"{site.base}/runs")
    console.wait_for_selector("#help")
    console.click("#help")
    assert console.input_value(CHOICE) == "light"


def test_charts_and_the_frame_of_the_3d_view_change_with_it(console: Any, until: Any) -> None:
    axis = """() => { const c = document.querySelector('#chart-0 canvas'), { width, height } = c;
      const { data } = c.getContext('2d').getImageData(0, 0, Math.round(width / 12), height);
      let sum = 0, count = 0;
      for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 200) { sum += data[i]; count++; }
      return count ? sum / count : -1; }"""
    console.emulate_media(color_scheme="dark")
    until(lambda: console.evaluate(axis) > 110)
    choose(console, "light")
    until(lambda: 0 <= console.evaluate(axis) < 110)
    frame = "document.getElementById('scene').contentDocument.documentElement.dataset.theme"
    assert console.evaluate(frame) == "light"
    choose(console, "")
    assert console.evaluate(frame) == "dark"
