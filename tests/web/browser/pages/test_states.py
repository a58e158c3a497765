"""Every page in its main states: axe-core in both themes, and its fit to the window.

axe-core checks the whole console once, in the state "fly", and in its other states only what they
add. The windows are 1024 x 700 to 2560 x 1440.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

SIZES = ((1440, 900), (1024, 700), (2560, 1440))
STATES = (
    "guide",
    "people",
    "fly",
    "experiments",
    "gains",
    "gains_history",
    "beacons",
    "link",
    "tune",
    "calibrating",
    "calibrate",
    "signals",
    "charts",
    "pad_editor",
    "runs",
    "replay",
    "compare",
    "design",
    "setup",
    "kill",
    "sign_in",
)
"""Methods of page_states.Room, in the cheapest order; the last signs out."""
ADDED = {
    "guide": "#help-panel",
    "people": "#people",
    "experiments": "#side",
    "gains": "#side",
    "gains_history": "#tab-gains",
    "beacons": "#tab-beacons",
    "link": "#tab-link",
    "tune": "#tab-tune",
    "calibrating": "#tab-calibrate",
    "calibrate": "#tab-calibrate",
    "signals": "#chart-0",
    "charts": "#charts",
    "pad_editor": "#stick-editor",
}
"""The part of the console that a state adds to the state "fly"."""


@pytest.fixture(scope="module")
def room(flying_lab: Any, chromium: Any, helper: Any, lab_of_pages: Any) -> Iterator[Any]:
    problems: list[str] = []
    width, height = SIZES[0]
    context = chromium.new_context(viewport={"width": width, "height": height})
    context.set_default_timeout(20_000)
    page = context.new_page()
    page.on("pageerror", lambda error: problems.append(f"{error}\n{error.stack}"))
    runs = (lab_of_pages.RUN, lab_of_pages.LATER)
    made = helper("browser/page_states").Room(page, flying_lab, runs)
    made.enter(lab_of_pages.NAME, lab_of_pages.PASSWORD)
    yield made
    context.close()
    assert problems == []


@pytest.mark.parametrize("state", STATES)
def test_a_state_is_accessible_and_nothing_is_crooked(
    room: Any, axe_in_both_themes: Any, crooked: Any, state: str
) -> None:
    page = room.page
    getattr(room, state)()
    found = axe_in_both_themes(page, ADDED.get(state, "body"))
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate("() => new Promise((done) => requestAnimationFrame(() => setTimeout(done)))")
        found += [f"at {width} x {height}: {line}" for line in crooked(page)]
    width, height = SIZES[0]
    page.set_viewport_size({"width": width, "height": height})
    assert found == []


def test_tab_goes_through_everything_in_order_and_the_focus_is_seen(
    chromium: Any, flying_lab: Any
) -> None:
    with flying_lab.sign_in() as admin:
        cookies = flying_lab.cookies_of(admin)
    context = chromium.new_context(viewport={"width": 1440, "height": 900})
    context.add_cookies(cookies)
    page = context.new_page()
    page.goto(f"{flying_lab.base}/")
    page.wait_for_selector("#behaviors button")
    page.wait_for_selector("#land:enabled")
    page.keyboard.press("Escape")  # the help of the first visit
    page.reload()  # to start from the beginning
    page.wait_for_selector("#land:enabled")
    page.wait_for_selector("#who:not(:empty)")  # the key handlers are active
    page.keyboard.press("3")  # the Gains tab
    page.wait_for_selector("#tab-gains", state="visible")
    wanted = ["land", "emergency-land", "cut", "who", "help", "view-camera", "open-gains", "search"]
    passed, unseen = [], []
    for _ in range(40):
        page.keyboard.press("Tab")
        name, is_seen = page.evaluate(
            """() => { const at = document.activeElement, look = getComputedStyle(at);
            return [at.id, at.tagName === 'IFRAME' || look.outlineStyle !== 'none']; }"""
        )
        passed.append(name)
        if not is_seen:
            unseen.append(name)
        if name == wanted[-1]:
            break
    context.close()
    assert [name for name in passed if name in wanted] == wanted
    assert unseen == []
