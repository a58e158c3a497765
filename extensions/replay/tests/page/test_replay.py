"""Replay page in Chromium: all ways to move, two runs compared, and nothing live touched."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from benchmarks.logs.recorded_run import MadeRun, write_run
from console.catalogue.catalogue import Catalogue
from console.runs.adoption import tidy_runs
from extensions.vision.tags.detector import marked_picture

RUN, LATER = "20260131T093042Z_quad1", "20260131T100000Z_quad1"
MADE = MadeRun(
    16.0,
    silence=(9.0, 10.0),
    marks=[(7.0, "gust")],
    changes=[(8.0, "control.position.kp_xy", 4.0, 5.5)],
)
BOUND = 60_000  # ms
BAR = "#line .bar"


@pytest.fixture(scope="module")
def replay_site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[type], Any]]:
    data = tmp_path_factory.mktemp("data")
    write_run(data / "runs" / f"{RUN}.mcap", MADE)
    grey = np.full((48, 64), 90, np.uint8)
    wide = np.full((48, 96), 90, np.uint8)
    pictures = [(6.0, marked_picture(grey, {}, ())), (8.0, marked_picture(wide, {}, ()))]
    made = MadeRun(18.0, late=2.0, pictures=pictures)
    write_run(data / "runs" / f"{LATER}.mcap", made, seed=2)
    catalogue = Catalogue(data)
    tidy_runs(catalogue)
    running: list[Any] = []

    def site(serve: type) -> Any:
        if not running:
            running.append(serve(data, catalogue))
            running.append(running[0].__enter__())
        return running[1]

    yield site
    if running:
        running[0].__exit__()


@pytest.fixture
def open_replay(replay_site: Any, serve: type, context: Any) -> Iterator[Callable[..., Any]]:
    """Yield a function that opens replays as a viewer.

    Errors in scripts and websockets to the live scene are failures.
    """
    problems: list[str] = []
    sockets: list[str] = []
    site = replay_site(serve)
    with site.sign_in() as admin, site.invited(admin, "viewer") as viewer:
        cookies = [{"name": k, "value": v, "url": site.base} for k, v in viewer.cookies.items()]
    context.add_cookies(cookies)

    def open_at(query: str = RUN, place: str = "replay/", ready: str = "main[data-shown]") -> Any:
        page = context.new_page()
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on("websocket", lambda socket: sockets.append(socket.url))
        page.goto(f"{site.base}/{place}{query}")
        page.wait_for_selector(ready, timeout=BOUND)
        return page

    yield open_at
    assert problems == []
    assert [url for url in sockets if "viser" in url] == []


@pytest.fixture
def replay(open_replay: Any) -> Any:
    return open_replay(f"{RUN}#t=5")


def at(page: Any, t: float, within: float = 0.0) -> None:
    """Wait until the page shows this instant everywhere."""
    page.wait_for_function(
        "([t, d]) => Math.abs(Number(document.querySelector('main').dataset.shown) - t) <= d",
        arg=[t, within + 5e-4],
        timeout=BOUND,
    )
    now = float(page.get_attribute(BAR, "aria-valuenow"))
    assert now == pytest.approx(t, abs=within + 1e-3)


def test_keys_move_by_frames_and_seconds_and_to_the_ends(replay: Any) -> None:
    for key, t in (
        ("ArrowRight", 5.02),
        ("Shift+ArrowRight", 6.02),
        ("ArrowLeft", 6.0),
        ("Shift+ArrowLeft", 5.0),
        ("Home", 0.0),
    ):
        replay.keyboard.press(key)
        at(replay, t)
    replay.keyboard.press("End")
    at(replay, 16.0, within=0.03)


def test_dragging_the_bar_seeks(replay: Any) -> None:
    box = replay.locator(BAR).bounding_box()
    y = box["y"] + box["height"] / 2
    replay.mouse.move(box["x"] + 0.3 * box["width"], y)
    replay.mouse.down()
    at(replay, 0.3 * 16.0, within=0.05)
    replay.mouse.move(box["x"] + 0.75 * box["width"], y)
    at(replay, 0.75 * 16.0, within=0.05)
    replay.mouse.up()
    replay.mouse.move(box["x"], y)
    at(replay, 0.75 * 16.0, within=0.05)


def test_the_values_are_those_of_the_instant(replay: Any, look_at: Any) -> None:
    replay.goto(f"{replay.url.split('#')[0]}#t=4.5")
    replay.reload()
    replay.wait_for_selector("main[data-shown]", timeout=BOUND)
    look = look_at(replay)
    height = "#table tr:has(td:first-child:text-is('position')) td >> nth=3"
    look.text(height, r"^0\.(49|50)\d$")  # half way up: 1.5 s of 3 s
    look.text("#table tbody tr >> nth=0", "armed · take off")
    look.text("#transport output >> nth=0", r"^0:04\.500$")
    look.text("#transport output >> nth=1", r"^0:01\.400$")  # since 3.1 s
    look.text("#transport output >> nth=2", r"\d\d:\d\d:\d\d\.\d\d\d$")


def test_values_of_a_silent_time_are_grey(replay: Any, look_at: Any) -> None:
    replay.keyboard.press("Home")
    for _ in range(9):
        replay.keyboard.press("Shift+ArrowRight")
    for _ in range(40):
        replay.keyboard.press("ArrowRight")
    at(replay, 9.8)
    look_at(replay).has_class("#table tr:has(td:first-child:text-is('position'))", "stale")


@pytest.mark.parametrize(("key", "direction"), [(" ", 1), ("r", -1)])
def test_it_plays_both_ways_and_stops(replay: Any, key: str, direction: int) -> None:
    for _ in range(3):
        replay.keyboard.press("]")
    assert replay.input_value("#transport select >> nth=0") == "8"
    replay.keyboard.press(key)
    end = 16.0 if direction > 0 else 0.0
    at(replay, end, within=0.03)
    pressed = "[...document.querySelectorAll('#transport [aria-pressed=true]')].length"
    assert replay.evaluate(pressed) == 0


def test_every_speed_can_be_chosen(replay: Any) -> None:
    found = replay.locator("#transport select >> nth=0").locator("option").all_inner_texts()
    assert found == ["⅛ ×", "¼ ×", "½ ×", "1 ×", "2 ×", "4 ×", "8 ×"]


def choose_view(page: Any, name: str) -> None:
    page.click("#chart-1 button[aria-label=view]")
    page.click(f"#chart-1 .menu.view button[name={name}]")


def test_the_address_carries_the_moment(replay: Any, open_replay: Any) -> None:
    replay.keyboard.press("Shift+ArrowRight")
    replay.select_option("#transport .shows select", "3")
    replay.wait_for_function("() => location.hash === '#t=6.000&w=3'", timeout=BOUND)
    replay.click("#transport .copy")
    replay.wait_for_selector("#transport .copy:text-matches('Copied|See address bar')")
    assert replay.url.endswith("#t=6.000&w=3")
    other = open_replay(f"{RUN}#t=6.000&w=3")
    at(other, 6.0)
    assert other.input_value("#transport .shows select") == "3"


def test_charts_show_any_signal_of_the_log(replay: Any, look_at: Any) -> None:
    replay.click("#chart-1 >> text=Signals")
    replay.fill("#chart-1 input[type=search]", "estimator mass_variance")
    replay.wait_for_selector("#chart-1 .lists label >> nth=0")
    assert replay.locator("#chart-1 .lists label").count() == 1
    replay.fill("#chart-1 input[type=search]", "battery voltage")
    replay.click("#chart-1 .lists label >> nth=0")
    replay.keyboard.press("Escape")
    look_at(replay).text("#chart-1 .legend", r"voltage15\.99")
    assert "battery.voltage" in replay.evaluate("localStorage.getItem('replay.chart.1')")


def test_a_chart_shows_the_spectrum_of_its_signals_and_time_again(replay: Any) -> None:
    choose_view(replay, "spectrum")
    replay.wait_for_selector("#chart-1 .plot[aria-label$='over frequency'] canvas", timeout=BOUND)
    at(replay, 5.0)
    assert replay.locator("#state:not([hidden])").count() == 0
    choose_view(replay, "spectrogram")
    replay.wait_for_function(
        "() => document.querySelector('#chart-1 .heat')?.textContent.includes('√Hz')", timeout=BOUND
    )
    choose_view(replay, "time")
    replay.wait_for_selector("#chart-1 .plot[aria-label$='over time'] canvas", timeout=BOUND)
    at(replay, 5.0)


def test_wheel_and_drag_zoom_all_charts_and_double_click_shows_all(replay: Any) -> None:
    shown = "document.querySelector('#line .shown').style.width"
    box = replay.locator("#chart-0 .u-over").bounding_box()
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
    replay.mouse.move(x, y)
    replay.mouse.wheel(0, -600)
    replay.wait_for_function(f"() => parseFloat({shown}) < 60", timeout=BOUND)
    assert replay.input_value("#transport .shows select") == "zoom"
    replay.mouse.dblclick(x, y)
    replay.wait_for_function("() => document.querySelector('#line .shown').hidden", timeout=BOUND)
    replay.mouse.move(box["x"] + 0.25 * box["width"], y)
    replay.mouse.down()
    replay.mouse.move(box["x"] + 0.5 * box["width"], y, steps=4)
    replay.mouse.up()
    replay.wait_for_function(f"() => Math.abs(parseFloat({shown}) - 25) < 2", timeout=BOUND)


def test_events_marks_and_changes_lead_to_their_moments(replay: Any, look_at: Any) -> None:
    look = look_at(replay)
    replay.click(".happened li:has-text('gust') button")
    at(replay, 7.0)
    look.has_class(".happened li:has-text('gust')", "now")
    replay.click("#side >> text=Parameters")
    replay.fill("#side input[type=search]", "kp_xy")
    look.text(".values tr:has-text('kp_xy') td >> nth=1", r"^4$")
    for _ in range(2):
        replay.keyboard.press("Escape")
    replay.locator("#view canvas").focus()
    replay.keyboard.press("Shift+ArrowRight")
    at(replay, 8.0)
    look.text(".values tr:has-text('kp_xy') td >> nth=1", r"^5\.5$")
    look.text(".values tr:has-text('kp_xy') small", r"was 4, 0:08\.0 by anna")


def test_the_time_line_names_behaviors_and_marks(replay: Any) -> None:
    names = replay.locator("#line .behavior span").all_inner_texts()
    assert names == ["ground", "take off", "follow trajectory", "land", "ground"]
    assert replay.locator("#line .mark").inner_text() == "gust"


def test_the_view_is_drawn_and_turns(replay: Any) -> None:
    picture = "document.querySelector('#view canvas').toDataURL()"
    before = replay.evaluate(picture)
    replay.keyboard.press("Shift+ArrowRight")
    at(replay, 6.0)
    flown = replay.evaluate(picture)
    assert flown != before
    box = replay.locator("#view canvas").bounding_box()
    replay.mouse.move(box["x"] + 300, box["y"] + 100)
    replay.mouse.down()
    replay.mouse.move(box["x"] + 400, box["y"] + 120, steps=2)
    replay.mouse.up()
    assert replay.evaluate(picture) != flown


def test_two_runs_are_aligned_at_take_off_or_where_one_wants(
    open_replay: Any, look_at: Any
) -> None:
    page = open_replay(f"{RUN}?with={LATER}#t=4.6")
    look = look_at(page)
    values = "#table tr:has(td:first-child:text-is('position')) td >> nth=3"
    second = "#table tr:has(td:first-child:text-is('position')) + tr td >> nth=3"
    at(page, 4.6)
    for cell in (values, second):  # each 1.5 s after its own take-off
        look.text(cell, r"^0\.5\d\d$")
    first = "#runs-shown select[aria-label='moment of the first run']"
    page.select_option(first, "start of recording")
    other = first.replace("first", "second")
    page.select_option(other, "start of recording")
    look.text(values, r"^0\.5\d\d$")
    look.text(second, r"^−?0\.00\d$")  # on the ground until 5 s
    page.fill("#runs-shown input", "-2")
    page.keyboard.press("Enter")
    look.text(second, r"^0\.5\d\d$")
    page.wait_for_function("() => location.hash.includes('by=-2.00')", timeout=BOUND)
    lane = page.locator("#line .behavior.second").bounding_box()
    page.mouse.move(lane["x"] + 300, lane["y"] + 8)
    page.mouse.down()
    page.mouse.move(lane["x"] + 340, lane["y"] + 8, steps=2)
    page.mouse.up()
    page.wait_for_function(
        "() => Number(document.querySelector('#runs-shown input').value) > -1.9", timeout=BOUND
    )


def test_a_run_that_is_not_there_is_said_in_one_line(open_replay: Any, replay: Any) -> None:
    replay.goto(replay.url.split("/replay")[0] + "/replay/unknown")
    replay.wait_for_selector("#state.warn", timeout=BOUND)
    assert "no run 'unknown'" in replay.inner_text("#state")


def test_it_holds_no_more_after_many_seeks(replay: Any) -> None:
    """The numbers of nodes and listeners of the page stay constant."""
    session = replay.context.new_cdp_session(replay)
    session.send("Performance.enable")
    box = replay.locator(BAR).bounding_box()
    y = box["y"] + box["height"] / 2
    replay.mouse.move(box["x"] + 1, y)
    replay.mouse.down()

    def counted() -> dict[str, float]:
        session.send("HeapProfiler.collectGarbage")
        found = session.send("Performance.getMetrics")["metrics"]
        return {one["name"]: one["value"] for one in found}

    def drag() -> None:
        for k in range(40):
            replay.mouse.move(box["x"] + (0.1 + 0.02 * k) * box["width"], y)
        at(replay, 0.88 * 16.0, within=0.05)

    drag()
    before = counted()
    drag()
    after = counted()
    assert after["JSEventListeners"] <= before["JSEventListeners"]
    assert after["Nodes"] <= before["Nodes"] + 50


def test_a_finding_opens_its_moment_with_its_signals(
    open_replay: Any, context: Any, look_at: Any
) -> None:
    """The run has none: one is added to the server's answer."""
    finding = {
        "kind": "motor_weak",
        "weight": 2.0,
        "from": 6.0,
        "to": 10.0,
        "text": "The rear motor needed 12 % more thrust.",
        "signals": ["thrust.front", "thrust.rear"],
    }

    def described(route: Any) -> None:
        answer = route.fetch()
        route.fulfill(response=answer, json={**answer.json(), "findings": [finding]})

    context.route(f"**/api/replay/{RUN}", described)
    page = open_replay(f"{RUN}#t=1&s=thrust.left")
    look = look_at(page)
    look.text("#chart-0 .legend", "left")
    look.text(".findings span", r"12 % more thrust")
    page.click(".findings button")
    at(page, 6.0)
    look.text("#chart-0 .legend", r"front.*rear")
    page.wait_for_function("() => location.hash.startsWith('#t=6.000&w=10')", timeout=BOUND)
    assert page.evaluate("localStorage.getItem('replay.chart.0')") is None


def test_a_cameras_picture_follows_the_play_head(open_replay: Any) -> None:
    page = open_replay(f"{LATER}#t=7")
    canvas, quiet = "#view .pictures canvas", "#view .pictures .quiet"
    page.wait_for_selector(f"{canvas}[width='64']")
    assert page.is_hidden(quiet)
    page.keyboard.press("Shift+ArrowRight")
    page.keyboard.press("Shift+ArrowRight")
    page.wait_for_selector(f"{canvas}[width='96']")
    page.keyboard.press("End")
    page.wait_for_selector(f"{quiet} >> text=No picture for 9 s")
    page.wait_for_selector("#view .pictures figure.old")
    page.keyboard.press("Home")
    page.wait_for_selector(f"{quiet} >> text=No picture yet")
    assert page.inner_text("#view .pictures figcaption") == "Camera on board"
    assert open_replay(f"{RUN}#t=5").locator("#view .pictures canvas").count() == 0


# ---------------------------------------------------------------------- several runs compared
PARAMETERS = "#parameters h2"


def test_runs_are_compared_about_their_take_off_and_a_link_shows_the_same(
    open_replay: Any, look_at: Any
) -> None:
    page = open_replay(f"?run={RUN}&run={LATER}", "compare", PARAMETERS)
    look = look_at(page)
    assert page.input_value("#tools select") == "take_off"
    assert page.locator("#signals .chart").count() == 6  # three signals, and their differences
    box = page.locator("#signals .plot >> nth=2").bounding_box()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"])
    look.text("#signals .chart >> nth=2 >> .legend", r"A[\d.]+B[\d.]+")
    look.text("#signals .chart >> nth=3 >> .legend", r"B − A[−]?0\.0\d")
    page.click("#tools button:has-text('One chart per run')")
    assert page.locator("#signals .chart").count() == 9
    page.click("#tools button:has-text('Difference')")
    assert page.locator("#signals .chart").count() == 6
    page.select_option("#tools select", "start")
    page.wait_for_function("() => location.hash.startsWith('#at=start&split=1&difference=0')")
    again = open_replay(page.url.partition("compare")[2], "compare", PARAMETERS)
    assert again.input_value("#tools select") == "start"
    assert again.locator("#signals .chart").count() == 6


def test_a_run_that_cannot_be_compared_says_why_in_its_line(open_replay: Any, look_at: Any) -> None:
    page = open_replay(
        f"?run={RUN}&run={LATER}&run=nowhere#s=state.position.z", "compare", PARAMETERS
    )
    look = look_at(page)
    look.text("#compared li >> nth=2 >> .note", "no run")
    assert page.locator("#signals .chart").count() == 2
    page.click("#compared li >> nth=1 >> a[aria-label^=remove]")
    look.text("#state", "^Only one of these runs can be compared.$")


def test_while_a_run_is_read_the_page_shows_its_outline_and_how_far_it_is(
    context: Any, open_replay: Any
) -> None:
    asked: list[str] = []

    def answer(route: Any) -> None:
        asked.append(route.request.url)
        if len(asked) > 2:
            route.continue_()
        else:
            route.fulfill(json={"state": "building", "progress": 0.25 * len(asked)})

    context.route(f"**/api/replay/{RUN}", answer)
    page = open_replay(f"{RUN}#t=5", ready="#state progress:not([hidden])")
    assert page.locator(".outline").count() == 6
    page.wait_for_function(
        "() => document.querySelector('#state').textContent.endsWith(': 50 %')", timeout=BOUND
    )
    page.wait_for_selector("main[data-shown]", timeout=BOUND)
    assert page.locator(".outline, #state progress").count() == 0
