"""Calibrate tab in Chromium: choose, be guided, judge, accept; and which buttons are disabled."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from vehicle_link.parameters.messages import from_parameters

TAB = "#tab-calibrate"
START, LINE = f"{TAB} .act .hold >> visible=true", f"{TAB} .act .line"
ROWS, FOUND = ".calibrations tbody tr", ".outcome .found tbody tr"


@pytest.fixture(scope="module")
def calibrating(helper: Any) -> Any:
    return helper("calibrating")


@pytest.fixture(scope="module")
def bench_of_all(site: Any, calibrating: Any) -> Iterator[Any]:
    made, ended = calibrating.Bench(site.station), threading.Event()

    def fly() -> None:
        while not ended.wait(0.02):
            site.station.fly()

    thread = threading.Thread(target=fly, daemon=True)
    thread.start()
    yield made
    ended.set()
    thread.join()


@pytest.fixture(scope="module")
def open_tab(bench_of_all: Any, chromium: Any, site: Any) -> Iterator[Callable[..., Any]]:
    """Yield `open_tab(cookies)`, the tab on a separate page; a link signs it in without them."""
    problems: list[str] = []
    contexts = []

    def open_with(cookies: Any = None) -> Any:
        context = chromium.new_context(viewport={"width": 1440, "height": 900})
        contexts.append(context)
        context.set_default_timeout(20_000)
        if cookies:
            context.add_cookies(cookies)
        page = context.new_page()
        page.on("pageerror", lambda error: problems.append(f"{error}\n{error.stack}"))
        page.goto(f"{site.base}/" if cookies else f"{site.base}/?token={site.token}")
        page.wait_for_selector("#behaviors button")
        page.keyboard.press("Escape")  # the help of the first visit
        page.click("#open-calibrate")
        page.wait_for_selector(ROWS)
        return page

    yield open_with
    for context in contexts:
        context.close()
    assert problems == []


@pytest.fixture(scope="module")
def page_of_all(open_tab: Callable[..., Any]) -> Any:
    return open_tab()


@pytest.fixture
def bench(bench_of_all: Any) -> Any:
    bench_of_all.begin()
    return bench_of_all


@pytest.fixture
def tab(bench: Any, page_of_all: Any) -> Any:
    page_of_all.click("#open-calibrate")
    return page_of_all


@pytest.fixture
def see(tab: Any, look_at: Any) -> Any:
    return look_at(tab)


def asked(bench: Any, action: str) -> list[Any]:
    return [
        request
        for service, request in bench.station.requests
        if service == "experiment" and request.action == action
    ]


def test_a_calibration_is_chosen_and_started_by_a_hold(
    tab: Any, see: Any, bench: Any, until: Any, calibrating: Any
) -> None:
    see.text(f"{ROWS} >> nth=0", r"^Gyroscope.*at power-up✓within limit$")
    see.text(f"{ROWS} >> nth=2", "^Motor benchnever$")
    see.text(f"{ROWS} >> nth=1", "anna!changed$")  # the vehicle has other values by then
    tab.check(".calibrations input[value=accelerometer]")
    see.text(f"{TAB} .needs", "^Needs: the vehicle in your hands")
    tab.fill(f"{TAB} input[aria-label=poses]", "3")
    until(lambda: tab.is_enabled(START))
    bench.station.requests.clear()
    see.hold(START, lambda: tab.is_visible(f"{TAB} > .reason"))
    see.text(f"{TAB} > .reason", "^accelerometer: poses = 3; allowed 4 to 40")
    assert asked(bench, "start") == []
    tab.fill(f"{TAB} input[aria-label=poses]", "9")
    see.hold(START, lambda: len(asked(bench, "start")) == 1)
    [request] = asked(bench, "start")
    assert request.name == "accelerometer"
    assert from_parameters(request.options) == {"method": "tracker", "poses": 9, "hold": 1.0}
    bench.station.said = {**bench.GROUND, "mode": "armed", "armed": True}
    see.text(LINE, "^The vehicle is armed; a calibration starts on the ground")
    bench.station.said, bench.status = dict(bench.GROUND), calibrating.told("bearings")
    see.text(LINE, "^Bearings is running, started by anna")
    assert tab.is_disabled(START)


def test_while_it_runs_it_guides_asks_and_shows_what_it_measures(
    tab: Any, see: Any, bench: Any, until: Any, calibrating: Any
) -> None:
    live = {**calibrating.pose_figures(5), "condition number": (14.25, "")}
    bench.status = calibrating.told(
        "accelerometer",
        live,
        instruction="Hold the vehicle nose up",
        question="In your hands?",
        step_number=6,
        step_count=12,
        step_share=0.5,
    )
    see.text(".run .instruction", "^Hold the vehicle nose up$")
    see.text(".run .number", "^Step 6 of 12$")
    assert tab.get_attribute(".run [role=progressbar]", "aria-valuenow") == "46"
    assert tab.locator(".sphere .held").count() == 5
    assert "Next: 20° nose" in tab.get_attribute(".sphere", "aria-label")
    see.text(".run .live", "^condition number14.25$")  # poses are drawn on the sphere
    assert tab.is_hidden(".calibrations")
    bench.station.requests.clear()
    see.hold(".run .question button", lambda: len(asked(bench, "confirm")) == 1)
    assert from_parameters(asked(bench, "confirm")[0].options) == {"question": "In your hands?"}
    for k in range(4):
        figures = {"mass": (1.2 + 0.02 * k, "kg"), "mass deviation": (0.1 / (k + 1), "kg")}
        bench.status = calibrating.told("mass", figures, instruction="It learns", elapsed=5.0 + k)
        see.text(".run .live", rf"^mass1\.{20 + 2 * k}0 ±")
    tab.wait_for_selector(".live-plots canvas")
    tab.click(".run .act button >> nth=1")
    until(lambda: len(asked(bench, "stop")) == 1)


def test_a_result_stands_beside_what_was_and_is_in_force_once_accepted(
    tab: Any, see: Any, bench: Any, calibrating: Any
) -> None:
    bench.status = calibrating.ended("accelerometer", calibrating.accelerometer())
    see.text(".outcome .head b", "^Accelerometer: passed$")
    see.text(f"{FOUND} >> nth=0", r"^xx1\.00001\.0042\+0\.42 %$")
    see.text(
        ".outcome .quality tbody tr >> nth=0", r"^residual, rms0\.018000\.05m/s²✓within limit$"
    )
    assert tab.locator(".outcome .residuals li").count() == 12
    see.has_class("#open-calibrate", "waits")
    tab.click(".outcome button:text-is('Accept')")
    see.text(".outcome .said", "^✓ Accepted. It is in force")
    see.text(".outcome caption >> nth=0", "^Values before and after$")
    see.text(f"{FOUND} >> nth=0", r"^xx1\.00001\.0042\+0\.42 %$")
    see.text(f"{ROWS} >> nth=1", "^Accelerometertoday .*within limit$")
    assert bench.station.store.get("imu.accelerometer_xx") == 1.0042
    bench.status = calibrating.ended("motor_bench", calibrating.motor(), elapsed=300.0)
    see.text(".outcome .warnings", "found from force alone")
    see.text(".outcome .quality tr.beyond", "beyond limit$")
    tab.wait_for_selector(".fit canvas")
    assert tab.is_visible(".outcome button:text-is('Accept anyway')")
    bench.station.requests.clear()
    tab.click(".outcome button:text-is('Reject')")
    see.text(".outcome .said", "^Rejected. Nothing was changed.$")
    assert len(asked(bench, "reject")) == 1


def test_the_experiments_have_no_calibrations_and_say_why_a_file_cannot_run(
    tab: Any, see: Any, calibrating: Any
) -> None:
    tab.click("[data-tab=experiments]")
    tab.wait_for_selector("#experiment .card")
    assert tab.locator("#experiment .card b").all_text_contents() == [
        "bearings",
        "my hops",
        "my_slip.py",
    ]
    tab.click("#experiment .card:nth-child(2) .head")
    see.text("#experiment .open .about", calibrating.ABOUT["my_hops"])
    tab.click("#experiment .card:nth-child(3) .head")
    see.text("#experiment .open .about", "^my_slip.py line 12: invalid syntax")
    assert tab.is_disabled("#experiment .start")


def test_a_viewer_looks_and_what_is_old_is_grey(
    bench: Any, site: Any, viewer: Any, open_tab: Any, look_at: Any, calibrating: Any
) -> None:
    page = open_tab(site.cookies_of(viewer))
    see = look_at(page)
    see.text(LINE, "^Viewers cannot calibrate; ask an operator.$")
    bench.status = calibrating.told("accelerometer", instruction="Hold it", question="Ready?")
    see.text(".run .instruction", "^Hold it$")
    buttons = page.locator(f"{TAB} button >> visible=true").all()
    assert len(buttons) == 3
    assert all(button.is_disabled() for button in buttons)
    bench.falls_silent()
    see.has_class(".run .guide", "old")
