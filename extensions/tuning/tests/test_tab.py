"""Tune tab: when a test may begin, its progress, chart, tables, delete and undo."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

RUN, BRAKE = "#tab-tune .act button >> nth=0", "#tab-tune .act button >> nth=1"
LINE = "#tab-tune .line"
BOXES = ".tests input[type=checkbox]"
KP = "control.position.kp_xy"


@pytest.fixture
def tab(open_page: Any, tune_site: Any) -> Iterator[Any]:
    """Yield a page with the tab open, on a vehicle in hover."""
    page = open_page(tune_site)
    page.click("[data-tab=tune]")
    page.wait_for_selector("#tab-tune .tests li")  # the stored tests have been read
    vehicle = tune_site.vehicle
    yield page
    vehicle.behavior, vehicle.airborne, vehicle.log_problem = "hover", True, ""
    vehicle.lasts = False
    vehicle.ends_with, vehicle.ends_after, vehicle.lose = "hover", math.inf, None


@pytest.fixture
def seen(tab: Any, look_at: Any) -> Any:
    return look_at(tab)


def fly(tab: Any, **fields: Any) -> None:
    """Run one test on the page, to its end."""
    for label, value in fields.items():
        tab.fill(f"#tab-tune input[aria-label^={label}]", str(value))
    before = tab.locator(BOXES).count()
    tab.expect(RUN, "enabled", True)
    tab.click(RUN)
    tab.expect(BOXES, "count", before + 1)


def test_a_test_begins_in_hover_only_and_the_page_says_why_not(
    tab: Any, seen: Any, tune_site: Any
) -> None:
    vehicle = tune_site.vehicle
    seen.text(LINE, "^$")
    vehicle.airborne = False
    seen.text(LINE, "on the ground: take off first")
    assert tab.is_disabled(RUN)
    vehicle.airborne, vehicle.behavior = True, "fly_to"
    seen.text(LINE, "The vehicle's behavior is fly to; a test starts from hover")
    vehicle.behavior = "hover"
    tune_site.station.control("operator 9")
    seen.text(LINE, "operator 9 has control; ask for it")
    tune_site.station.control("")
    tab.fill("#tab-tune input[aria-label=amplitude]", "0.9")
    seen.text(LINE, r"Amplitude: at most 0\.6 m \(behavior\.excite_position_max\)")
    tab.select_option("#tab-tune select[aria-label=axis]", "yaw")
    seen.value("#tab-tune input[aria-label=amplitude]", "20")
    seen.text(LINE, "^$")
    assert tab.is_enabled(RUN)


def test_a_test_is_drawn_judged_and_compared_with_the_one_before(
    tab: Any, seen: Any, tune_site: Any
) -> None:
    fly(tab, amplitude="0.3", duration="2")
    seen.text(".figures-of-tests tr:has-text('overshoot')", r"overshoot16\.\d%")
    answer = tab.evaluate(
        "fetch('/api/parameters', {method: 'PUT', headers: {'Content-Type': 'application/json'},"
        " body: JSON.stringify({values: {'control.position.kp_xy': 7}})}).then((a) => a.status)"
    )
    assert answer == 200
    fly(tab)
    seen.text(".figures-of-tests thead", "ABB − A")
    seen.text(".figures-of-tests tr:has-text('rise')", r"rise 10–90 %0\.8\d0\.6\d−0\.\d\ds")
    seen.text(".gains-of-tests tr:has-text('kp_xy')", r"position\.kp_xy47")
    label = "set-point and actual of A: x step, B: x step"
    tab.wait_for_selector(f".tune-chart .plot[aria-label='{label}']")
    assert tab.locator(".tune-chart canvas").count() == 1
    tab.click("button[aria-label='restore the gains of test A']")
    seen.text(LINE, r"Restored: position\.kp_xy 4")
    assert tune_site.station.store.get(KP) == 4.0
    tab.locator(BOXES).nth(1).uncheck()
    seen.text(".gains-of-tests caption", "Tick a second test")
    seen.text(".figures-of-tests thead", "^A$")


def test_the_phases_are_shown_and_brake_ends_the_flight(
    tab: Any, seen: Any, tune_site: Any
) -> None:
    tune_site.vehicle.lasts = True
    tab.fill("#tab-tune input[aria-label^=duration]", "10")
    tab.click(RUN)
    seen.text(LINE, "Flying: [0-9]+ of 2[01] s")
    assert tab.is_disabled(RUN)
    assert tab.is_disabled("#tab-tune select[aria-label=axis]")
    tune_site.station.requests.clear()
    tab.click(BRAKE)
    seen.text(LINE, "Done: .*it was stopped by brake")
    names = [r.name for s, r in tune_site.station.requests if s == "start_behavior"]
    assert names == ["brake"]


def test_what_is_missing_is_said_with_the_test(tab: Any, seen: Any, tune_site: Any) -> None:
    tune_site.vehicle.lose = (900, 999)
    fly(tab, duration="1")
    seen.text(".tests li >> nth=0", "1 gap in the vehicle's log")
    tune_site.vehicle.log_problem = "the vehicle did not answer"
    tab.click(RUN)
    seen.text(LINE, "Failed: the vehicle's log could not be read: the vehicle did not answer")


def test_a_deleted_test_is_taken_back_by_undo(tab: Any, seen: Any) -> None:
    fly(tab, duration="0.5")
    count = tab.locator(BOXES).count()
    tab.click(".tests .remove >> nth=0")
    tab.expect(BOXES, "count", count - 1)
    seen.text(".undone", "Deleted: x step")
    tab.click(".undone button")
    tab.expect(BOXES, "count", count)


def test_a_viewer_sees_tests_and_flies_none(
    tab: Any, tune_site: Any, context: Any, look_at: Any
) -> None:
    fly(tab, duration="0.5")
    with tune_site.sign_in() as admin:
        url = admin.post("/api/invitations", json={"role": "viewer"}).json()["url"]
    context.clear_cookies()
    page = context.new_page()
    page.goto(url)
    page.wait_for_selector("#behaviors button")
    page.click("[data-tab=tune]")
    look_at(page).text(LINE, "Viewers cannot run tests")
    look_at(page).text(".figures-of-tests thead", "A")
    for button in (RUN, BRAKE, ".gains-of-tests button >> nth=0", ".tests .remove >> nth=0"):
        assert page.is_disabled(button)
