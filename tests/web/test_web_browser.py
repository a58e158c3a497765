"""The page in Chromium. The 3D view is blanked but in the last tests, which need WebGL."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from console.catalogue import Catalogue

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = [
    "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--no-first-run",
]  # fmt: skip
BOUND = 20_000  # ms, for a broken page only

playwright_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
if not CHROMIUM.exists():
    pytest.skip(f"no {CHROMIUM}; install Debian's chromium", allow_module_level=True)


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with playwright_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def flying(site: Any, station: Any) -> Iterator[Callable[[bool], None]]:
    """A vehicle that publishes at 50 Hz; call with False to silence it."""
    going, talking = threading.Event(), threading.Event()
    going.set()
    talking.set()

    def fly() -> None:
        while going.is_set():
            if talking.is_set():
                station.fly()
            threading.Event().wait(0.02)

    thread = threading.Thread(target=fly, daemon=True)
    thread.start()
    yield lambda on: talking.set() if on else talking.clear()
    going.clear()
    thread.join()


@pytest.fixture
def context(chromium: Any) -> Iterator[Any]:
    made = chromium.new_context(viewport={"width": 1440, "height": 900})
    made.set_default_timeout(BOUND)
    yield made
    made.close()


def open_page(context: Any, site: Any, blank: bool = True) -> Any:
    """A signed-in page; errors in its scripts fail the test that closes it."""
    page = context.new_page()
    page.problems = []
    page.on("pageerror", lambda error: page.problems.append(str(error)))
    if blank:
        page.route("**/viser/**", lambda route: route.fulfill(status=200, body=""))
    page.goto(f"{site.base}/?token={site.token}")
    page.wait_for_selector("#behaviors button")
    return page


@pytest.fixture
def page(context: Any, site: Any, flying: Any) -> Iterator[Any]:
    made = open_page(context, site)
    yield made
    assert made.problems == []


def text_of(page: Any, selector: str, pattern: str) -> None:
    """Waits until the element's text matches."""
    expect = playwright_api.expect
    expect(page.locator(selector)).to_have_text(re.compile(pattern), timeout=BOUND)


def class_of(page: Any, selector: str, pattern: str) -> None:
    expect = playwright_api.expect
    expect(page.locator(selector)).to_have_class(re.compile(pattern), timeout=BOUND)


def test_a_link_signs_in_once(context: Any, site: Any, page: Any) -> None:
    assert page.url == f"{site.base}/"
    stranger = context.browser.new_context()
    late = stranger.new_page()
    late.goto(f"{site.base}/?token=used")
    assert "not valid" in late.inner_text("h1")
    assert "newest link" in late.inner_text("main")
    stranger.close()


def test_the_bar_shows_what_the_vehicle_says(page: Any) -> None:
    text_of(page, "#mode", "^armed$")
    text_of(page, "#behavior", "^hover$")
    text_of(page, "#link", "ms · 2.0 %")
    text_of(page, "#battery", "^15.6 V$")
    text_of(page, "#tracker", "^100 Hz$")
    text_of(page, "#tick", "^140 µs · 0.0 %$")
    text_of(page, "#recording", r"^● 00:12\s+84 MB$")
    text_of(page, "#flags", "not real time")


def test_what_is_old_is_grey_and_keeps_its_last_value(page: Any, flying: Any) -> None:
    text_of(page, "#mode", "^armed$")
    flying(False)
    class_of(page, "#mode", r"\bstale\b")
    text_of(page, "#mode", "^armed$")
    class_of(page, "#table tbody tr >> nth=0", r"\bstale\b")
    text_of(page, "#table tbody tr >> nth=0 >> td >> nth=1", r"^1\.000$")
    text_of(page, "#flags", r"no telemetry for")
    flying(True)
    playwright_api.expect(page.locator("#mode")).not_to_have_class(re.compile("stale"))


def test_the_state_table_shows_numbers_and_ages(page: Any) -> None:
    text_of(page, "#table tbody tr >> nth=0 >> td >> nth=3", r"^1\.500$")
    text_of(page, "#table tbody tr >> nth=5 >> td >> nth=3", r"^0\.500$")  # tracking error, z
    text_of(page, "#table tbody tr >> nth=0 >> td.age", r"ms$")


def test_a_refusal_is_shown_with_its_reason(page: Any, station: Any) -> None:
    station.refusal = "take_off refused: the motors are off; arm the vehicle first"
    page.click("#take-off")
    text_of(page, "#answer", "the motors are off; arm the vehicle first")
    page.fill("#behaviors input >> nth=0", "99")
    page.click("#take-off")
    text_of(page, "#answer", "height = 99; allowed 0.2 to 20 m")


def test_arming_needs_a_hold_and_a_click_does_nothing(page: Any, station: Any, until: Any) -> None:
    text_of(page, "#arm", "^Disarm$")
    station.requests.clear()
    page.click("#arm")
    page.click("#emergency-land")
    until(lambda: bool(station.requests))
    assert [name for name, _ in station.requests] == ["emergency"]
    page.hover("#arm")
    page.mouse.down()
    until(lambda: (page.wait_for_timeout(20), len(station.requests) == 2)[1])
    page.mouse.up()
    assert station.requests[-1][0] == "disarm"


def test_land_and_cut_are_two_emergencies(page: Any, station: Any, until: Any) -> None:
    page.click("#emergency-land")
    until(lambda: len(station.requests) == 1)
    page.hover("#cut")
    page.mouse.down()
    until(lambda: (page.wait_for_timeout(20), len(station.requests) == 2)[1])
    page.mouse.up()
    assert [request.action for _, request in station.requests] == ["land", "cut"]


KP = ".gain:has(input[aria-label='gains.kp'])"


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


def confirmed(page: Any, value: str) -> None:
    """Waits until the cell shows the value."""
    cell = page.locator(f"{KP} input.value")
    playwright_api.expect(cell).to_have_value(value, timeout=BOUND)


def test_a_slider_changes_the_vehicle_and_every_page_follows(
    context: Any, site: Any, page: Any
) -> None:
    other = open_page(context, site)
    for one in (page, other):
        open_gains(one)
    slide(page, 6.2)
    for one in (page, other):
        confirmed(one, "6.2")
        assert one.locator(f"{KP} input[type=range]").input_value() == "6.2"
    class_of(page, KP, r"\bchanged\b")
    page.click(f"{KP} .mark")
    confirmed(page, "4")
    other.close()


def test_a_cell_shows_only_what_is_confirmed_and_a_late_one_is_amber(
    page: Any, station: Any
) -> None:
    open_gains(page)
    before = value_of(page)
    station.answering.clear()
    slide(page, 12.5)
    class_of(page, KP, r"\bwaiting\b|\blate\b")
    assert value_of(page) == before
    class_of(page, KP, r"\blate\b")
    assert value_of(page) == before
    assert page.locator(f"{KP} input[type=range]").input_value() == before
    station.answering.set()
    confirmed(page, "12.5")
    slide(page, float(before))


def test_a_refused_value_shows_its_reason_and_reverts(page: Any, station: Any) -> None:
    open_gains(page)
    before = value_of(page)
    station.refusal = "gains.kp: the step is too large in flight"
    slide(page, 15.0)
    text_of(page, f"{KP} .reason", "the step is too large in flight")
    assert value_of(page) == before
    assert page.locator(f"{KP} input[type=range]").input_value() == before


def test_runs_can_be_downloaded(page: Any) -> None:
    page.click("[data-tab=runs]")
    page.wait_for_selector(".run a")
    with page.expect_download() as download:
        page.click(".run a >> nth=0")
    assert download.value.suggested_filename.endswith(".mcap")


def test_charts_draw_the_signals_that_were_chosen(page: Any, until: Any) -> None:
    page.click("#chart-1 button")
    page.click("#chart-1 .menu label:has-text('mass') input")
    page.keyboard.press("Escape")
    text_of(page, "#chart-1 .legend", "mass")
    text_of(page, "#chart-1 .legend span:has-text('mass') output", r"^1\.310$")
    drawn = """() => { const c = document.querySelector('#chart-0 canvas');
      return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((v) => v > 0); }"""
    until(lambda: page.evaluate(drawn))


PAD = """() => { window.pad = { connected: true, axes: [0, 0, 0, -1], buttons:
  Array.from({ length: 16 }, () => ({ pressed: false })) };
  navigator.getGamepads = () => [window.pad];
  document.hasFocus = () => true; }"""


def test_sticks_work_while_the_button_is_held_and_need_a_release_after_a_blur(
    page: Any, station: Any, until: Any
) -> None:
    station.sticks.clear()

    def hold(on: bool) -> None:
        page.evaluate(f"window.pad.buttons[4].pressed = {str(on).lower()}")

    def enabled() -> bool:
        page.wait_for_timeout(20)
        return bool(station.sticks) and station.sticks[-1][1]

    page.evaluate(PAD)
    hold(False)
    page.wait_for_timeout(100)
    hold(True)
    until(enabled)
    assert station.sticks[-1][0][0] == 1.0
    page.evaluate("dispatchEvent(new Event('blur'))")
    until(lambda: not enabled())
    page.wait_for_timeout(200)
    assert not enabled(), "still held: it must not come back by itself"
    hold(False)
    page.wait_for_timeout(100)
    hold(True)
    until(enabled)
    hold(False)
    until(lambda: not enabled())


def test_the_page_comes_back_by_itself_after_a_restart_of_web(
    context: Any, serve: Any, tmp_path: Path
) -> None:
    catalogue = Catalogue(tmp_path)
    with serve(tmp_path, catalogue) as first:
        page = open_page(context, first)
        port = int(first.host.split(":")[1])
    page.wait_for_selector("#offline:not([hidden])")
    text_of(page, "#offline", "No connection to quadlab web")
    with serve(tmp_path, catalogue, port=port) as again:
        page.wait_for_selector("#offline", state="hidden")
        again.station.fly()
        text_of(page, "#mode", "^armed$")
        page.close()
    catalogue.close()


def test_the_emergency_page_has_no_webgl_and_two_buttons(
    context: Any, site: Any, page: Any, station: Any, until: Any
) -> None:
    page.goto(f"{site.base}/kill")
    text_of(page, "#state", "armed, hover")
    assert page.locator("iframe, canvas").count() == 0
    page.click("#cut")
    text_of(page, "#answer", "Cut motors: accepted")
    assert [request.action for _, request in station.requests] == ["cut"]


def test_the_3d_view_shows_the_scene_and_reconnects(chromium: Any, site: Any, flying: Any) -> None:
    context = chromium.new_context(viewport={"width": 640, "height": 400})
    context.set_default_timeout(60_000)
    page = context.new_page()
    page.goto(f"{site.base}/?token={site.token}")
    page.wait_for_selector("#behaviors button")
    page.goto(f"{site.base}/?fixedDpr")
    frame = page.query_selector("#scene").content_frame()
    names = ["/vehicle", "/vehicle/rotor_3", "/truth", "/ground", "/flown/head", "/wanted/0"]
    has = "(names) => names.every((n) => n in (window.__viserSceneTree?.getState() ?? {}))"
    frame.wait_for_function(has, arg=names)
    shown = "() => window.__viserSceneTree.getState()['/vehicle'].visibility"
    assert frame.evaluate(f"{shown} !== false")
    assert len(set(page.locator("#scene").screenshot())) > 100, "the picture is blank"
    server = site.view_server.viser._websock_server
    before = set(server._live_connections)
    server.disconnect_all_clients()
    for _ in range(600):
        now = set(server._live_connections)
        if now and now.isdisjoint(before):
            break
        page.wait_for_timeout(50)
    else:
        pytest.fail("the view did not reconnect")
    context.close()
