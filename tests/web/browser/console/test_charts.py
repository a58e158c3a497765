"""Charts as a person uses them: choose, pause, zoom, save; an hour of frames in constant memory."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quadrotor.records import TICK
from tests.support.live_signals import packets_of
from tests.support.ticks import level_ticks
from vehicle_link.telemetry import pack
from web.latest import STALE, TICKS
from web.signals import SIGNALS


@pytest.fixture(scope="module")
def modules(chromium: Any, site: Any) -> Iterator[Any]:
    """Yield an empty page of the site, from which its modules can be loaded."""
    context = chromium.new_context()
    page = context.new_page()
    page.goto(f"{site.base}/?token={site.token}")
    page.wait_for_url(f"{site.base}/")  # it continues there by itself
    page.goto(f"{site.base}/kill")
    page.add_script_tag(url="/vendor/uPlot.iife.js")
    yield page
    context.close()


def test_names_beside_the_lines_leave_a_narrow_chart_to_the_lines(modules: Any) -> None:
    room = """async (width) => {
      const { Chart } = await import('/static/charts/chart.js');
      const lines = [{ label: "tracking error x" }, { label: "tracking error y" }];
      return Chart.prototype.room.call({ names: ["x", "y"], lines }, width);
    }"""
    assert modules.evaluate(room, 130) < 10
    assert modules.evaluate(room, 600) > 100


def layout_of(page: Any) -> Any:
    return json.loads(page.evaluate("localStorage.getItem('charts.now')"))


def chart_signals(page: Any, index: int) -> list[str]:
    return list(layout_of(page)["layout"]["charts"][index]["signals"])


def choose_view(page: Any, name: str) -> None:
    page.click("#chart-0 button[aria-label=view]")
    page.click(f"#chart-0 .menu.view button[name={name}]")


HOUR = """async ([names, minutes]) => {
  const { Telemetry } = await import('/static/core/sockets.js');
  const { History } = await import('/static/charts/history.js');
  const { TimeAxis } = await import('/static/charts/time_axis.js');
  const { Chart } = await import('/static/charts/chart.js');
  const { LiveSignals } = await import('/static/charts/live_signals.js');
  if (!window.hour) {
    const description = await (await fetch('/api/signals')).json();
    const telemetry = new Telemetry(description);
    telemetry.close();
    const place = document.body.appendChild(document.createElement('section'));
    const signals = new Map(description.signals.map((one) => [one.name, one]));
    const axis = new TimeAxis(new History(telemetry), 600);
    const chart = new Chart(place, { axis, source: new LiveSignals(axis, signals, 'hour'), names });
    window.hour = { telemetry, chart, ticks: 0 };
  }
  const { telemetry, chart } = window.hour, { history } = chart.axis, series = history.of(names[0]);
  const times = new Float64Array(20), columns = names.map(() => new Float32Array(20));
  for (let i = 0; i < minutes * 60 * 25; i++) {
    for (let k = 0; k < 20; k++) {
      times[k] = window.hour.ticks++ / 500;
      columns.forEach((column, n) => { column[k] = Math.sin(times[k] + n); });
    }
    series.add(times, columns);
    const detail = { time: times[19], slowness: 1, age: {}, value: {} };
    telemetry.dispatchEvent(new CustomEvent('frame', { detail }));
    if (i % 500) continue;
    chart.isSeen = true;
    chart.draw(performance.now() + i * 1e3);
    await null;
  }
  const [piece] = chart.pieces;
  return [series.end - series.start, series.times.length, piece.to - piece.from];
}"""


def test_an_hour_of_every_tick_leaves_nodes_and_memory_as_they_were(modules: Any) -> None:
    """Send an hour of ticks through history and a chart of ten minutes."""
    cdp = modules.context.new_cdp_session(modules)
    cdp.send("Performance.enable")
    names = [signal.name for signal in SIGNALS[:3]]

    def figures() -> dict[str, float]:
        cdp.send("HeapProfiler.collectGarbage")
        found = cdp.send("Performance.getMetrics")["metrics"]
        return {one["name"]: one["value"] for one in found}

    _, room, _ = modules.evaluate(HOUR, [names, 21])  # after the ring has wrapped
    before = figures()
    held, now, drawn = modules.evaluate(HOUR, [names, 60])
    after = figures()
    assert (held, now) == (600 * 500 + 1, room)
    assert drawn > 0.95 * held
    assert after["Nodes"] - before["Nodes"] < 50
    assert after["JSHeapUsedSize"] - before["JSHeapUsedSize"] < 2e6
    assert after["JSEventListeners"] - before["JSEventListeners"] < 10


def test_a_chart_shows_the_spectrum_of_the_last_seconds_and_says_why_it_cannot(
    open_page: Any, site: Any, until: Any
) -> None:
    page, count, sent = open_page(site), 2500, 0

    def come() -> None:
        """Let five more seconds of ticks come at once."""
        nonlocal sent
        numbers = np.arange(sent, sent + count)
        ticks, sent = np.zeros(count, TICK), sent + count
        ticks["imu"]["stamp_ns"] = 10**18 + 2_000_000 * numbers  # of a clock that began anew
        ticks["state"]["position_w"][:, 0] = np.sin(2.0 * np.pi * 40.0 * 0.002 * numbers)
        ticks["state"]["quaternion_wb"][:, 0] = 1.0
        for packet in packets_of(ticks):
            site.station._live.put(TICKS, packet, 1)

    def comes(selector: str, wanted: str) -> None:
        def is_there() -> bool:
            come()
            return wanted in page.locator(selector).first.inner_text()

        until(is_there)

    site.station._live.put(TICKS, pack(level_ticks(0, 1), 0), 1)
    choose_view(page, "spectrum")
    page.wait_for_function(
        "() => document.querySelector('#chart-0 output.state').textContent.includes('needs 2 s')"
    )
    come()
    page.wait_for_selector("#chart-0 .plot[aria-label$='over frequency'] canvas")
    comes("#chart-0 output.state", "")
    box = page.locator("#chart-0 .u-over").bounding_box()
    at = box["x"] + 40.0 / 250.0 * box["width"], box["y"] + 0.5 * box["height"]

    def reads_the_line() -> bool:
        come()
        page.mouse.move(at[0] - 30.0, at[1])  # the axis was under the cursor at that moment
        page.mouse.move(*at)
        shown = page.locator("#chart-0 .legend output").all_inner_texts()
        return any(float(text or 0.0) > 0.3 for text in shown)

    until(reads_the_line)
    choose_view(page, "spectrogram")
    page.wait_for_selector("#chart-0 .plot[aria-label$='over time and frequency'] .heat")
    comes("#chart-0 .heat", "m/√Hz")
    choose_view(page, "time")
    page.wait_for_selector("#chart-0 .plot[aria-label$='over time'] canvas")
    assert chart_signals(page, 0)[0] == "state.position.x"


def test_a_page_that_was_cut_off_has_no_hole_when_it_is_back(
    modules: Any, site: Any, until: Callable[..., None]
) -> None:
    """Five minutes come while the page has no connection."""
    sent = 0
    modules.evaluate("""async () => {
      const { Telemetry } = await import('/static/core/sockets.js');
      const { History } = await import('/static/charts/history.js');
      const telemetry = new Telemetry(await (await fetch('/api/signals')).json());
      window.lab = { telemetry, history: new History(telemetry) };
      window.lab.history.want('test', ['state.position.x']);
    }""")

    def come(count: int, spike: float = 0.0) -> None:
        nonlocal sent
        ticks = level_ticks(sent, count)
        ticks["imu"]["stamp_ns"] -= 10**17
        sent += count
        ticks["state"]["position_w"][count // 2, 0] = spike
        for packet in packets_of(ticks):
            site.station._live.put(TICKS, packet, 1)

    def held() -> list[float]:
        script = """() => { const one = window.lab.history.of('state.position.x');
          const { times, start, end, holes } = one, values = one.columns.get('state.position.x');
          let apart = 0, most = 0;
          for (let i = start; i < end; i++) {
            if (times[i] < times[i - 1]) throw new Error('it went back');
            if (i > start) apart = Math.max(apart, times[i] - times[i - 1]);
            most = Math.max(most, values[i]);
          }
          return [times[end - 1] - times[start], apart, most, holes.length]; }"""
        return list(modules.evaluate(script))

    come(50)
    until(lambda: held()[0] == pytest.approx(0.098))
    modules.evaluate("window.lab.telemetry.socket.close()")
    come(150_000, spike=7.0)
    until(lambda: (held()[0] or 0.0) > 299.0)
    passed, apart, most, holes = held()
    assert passed == pytest.approx(300.098)
    assert (most, holes) == (7.0, 0)
    assert apart < 0.3
    modules.evaluate("window.lab.telemetry.close()")


def test_a_derived_signal_is_charted_over_another_and_stays_after_a_reload(
    page: Any, look: Any
) -> None:
    page.click("#chart-1 >> text=Signals")
    page.click("#chart-1 summary >> text=derived by an expression")
    page.fill("#chart-1 .expression input", "twice = 2*state.position.q")
    page.click("#chart-1 .expression button >> text=Add")
    look.text(
        "#chart-1 details .problem", "^at character 3: no signal state.position.q; did you mean"
    )
    page.fill("#chart-1 .expression input", "twice = 2*state.position.x")
    page.click("#chart-1 .expression button >> text=Add")
    look.text("#chart-1 .legend", r"twice\d\.\d")
    assert chart_signals(page, 1)[-1] == "twice = 2*state.position.x"
    page.click("#chart-1 .menu.signals >> text=Close")
    choose_view(page, "xy")
    page.wait_for_selector("#chart-0 .plot[aria-label$='over position x, m'] canvas")
    page.click("#chart-1 button[aria-label=view]")
    page.check("#chart-1 .menu.view >> text=Statistics")
    look.text("#chart-1 .statistics tbody tr:last-child td:last-child", r"\d\.\d")
    page.reload()
    page.wait_for_selector("#chart-0 .plot[aria-label$='over position x, m'] canvas")
    look.text("#chart-1 .legend", r"twice\d\.\d")


# ---------------------------------------------------------------------- pause, zoom, cursor
def test_the_space_bar_pauses_and_still_presses_a_focused_button(
    kept_page: Any, look_at: Any, flying: Any
) -> None:
    page, look = kept_page, look_at(kept_page)
    look.text("#chart-0 .legend output >> nth=0", r"\d")
    page.mouse.click(700, 300)
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press(" ")
    look.text("#charts .state", r"paused for 00:(0[1-9]|[1-5]\d)")
    look.text("#charts .bar button >> nth=0", "^Resume$")
    page.keyboard.press(" ")
    look.text("#charts .bar button >> nth=0", "^Pause$")
    look.text("#charts .state", "^$")
    page.focus("#charts .bar button >> nth=0")
    page.keyboard.press(" ")
    look.text("#charts .bar button >> nth=0", "^Resume$")
    page.keyboard.press(" ")
    look.text("#charts .bar button >> nth=0", "^Pause$")


def test_a_hidden_page_draws_nothing_and_has_it_all_when_it_is_back(
    kept_page: Any, look_at: Any, flying: Any, until: Callable[..., None]
) -> None:
    page, look = kept_page, look_at(kept_page)
    look.text("#chart-0 .legend output >> nth=0", r"\d")
    page.evaluate("""() => {
      window.strokes = 0;
      const drawing = CanvasRenderingContext2D.prototype, { stroke } = drawing;
      drawing.stroke = function (...a) { window.strokes++; stroke.apply(this, a); };
      const get = () => window.away === true;
      Object.defineProperty(document, 'hidden', { configurable: true, get });
    }""")
    until(lambda: page.evaluate("window.strokes") > 0)
    page.evaluate(
        """() => { window.away = true; // and a drawing under way is done two frames later
        return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))); }"""
    )
    before = page.evaluate("window.strokes = 0")
    look.text("#charts .bar button >> nth=0", "Pause")
    assert (
        page.evaluate("new Promise((done) => setTimeout(() => done(window.strokes), 400))")
        == before
    ), "it would draw six times in this time"
    page.evaluate("window.away = false")
    until(lambda: page.evaluate("window.strokes") > 0)


def test_the_cursor_is_shared_and_its_values_are_read_out(
    kept_page: Any, look_at: Any, flying: Any
) -> None:
    page, look = kept_page, look_at(kept_page)
    look.text("#chart-0 .legend output >> nth=0", r"^1\.000$")
    page.focus("#chart-0 .plot")
    page.keyboard.press("Space")
    page.keyboard.press("ArrowLeft")
    for chart in ("#chart-0", "#chart-1"):
        page.wait_for_selector(f"{chart} .cursor:not([hidden])", state="attached")
    look.text("#chart-1 .legend output >> nth=2", r"\d|–")
    page.keyboard.press("Escape")
    page.wait_for_selector("#chart-1 .cursor[hidden]", state="attached")


def test_drag_and_wheel_zoom_within_bounds_and_a_double_click_comes_back(
    kept_page: Any, look_at: Any, flying: Any
) -> None:
    page, look = kept_page, look_at(kept_page)
    look.text("#chart-0 .legend output >> nth=0", r"\d")
    box = page.locator("#chart-0 .plot").bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + 300, box["y"] + 70, steps=3)
    page.mouse.up()
    look.text("#charts .state", r"paused .*, \d+(\.\d)? s shown")
    shown = re.search(r", ([\d.]+) s shown", page.inner_text("#charts .state"))
    assert shown is not None
    assert 2.0 < float(shown[1]) < 15.0
    page.mouse.dblclick(box["x"] + 200, box["y"] + 60)
    look.text("#charts .state", r"^paused for \d\d:\d\d$")
    page.click("#charts .bar button >> nth=0")
    page.mouse.move(box["x"] + 200, box["y"] + 60)
    page.mouse.wheel(0, -3000)
    look.value("#charts select >> nth=0", "5")
    page.mouse.wheel(0, 6000)
    look.value("#charts select >> nth=0", "600")


# ---------------------------------------------------------------------- choice and layouts
def test_charts_are_added_up_to_four_removed_and_grow_over_the_3d_view(page: Any) -> None:
    for count in (3, 4):
        page.click("#charts button[aria-label='add a chart']")
        assert page.locator("#charts .chart").count() == count
    assert page.is_disabled("#charts button[aria-label='add a chart']")
    for _ in range(3):
        page.click("#chart-0 button[aria-label='remove chart']")
    assert page.locator("#charts .chart").count() == 1
    assert page.is_hidden("#chart-0 button[aria-label='remove chart']")
    page.click("#chart-0 button[aria-label=expand]")
    box, view = (page.locator(one).bounding_box() for one in ("#chart-0", "#view"))
    assert box["width"] == pytest.approx(view["width"], abs=1)
    assert box["y"] > view["y"] + 30, "what is written on top stays in sight"
    page.keyboard.press("Escape")
    assert page.locator(".chart.expanded").count() == 0


def test_every_signal_is_found_and_a_chart_has_at_most_three_units(page: Any, look: Any) -> None:
    page.click("#chart-1 button:has-text('Signals')")
    menu = "#chart-1 .menu.signals"
    for search, name in (("roll", "state.roll"), ("thrust", "thrust")):
        page.fill(f"{menu} input[type=search]", search)
        page.click(f"{menu} input[data-name='{name}']")
    assert chart_signals(page, 1)[-2:] == ["state.roll", "thrust"]
    look.text(f"{menu} .note", "3 of 3 units")
    page.fill(f"{menu} input[type=search]", "voltage")
    assert page.is_disabled(f"{menu} input[data-name='battery.voltage']")
    assert page.is_enabled(f"{menu} .scales input[type=checkbox] >> nth=2")
    page.keyboard.press("Escape")
    assert page.locator(menu).count() == 0
    look.value("#charts select >> nth=1", "")
    page.click("#chart-0 button:has-text('Signals')")
    page.fill("#chart-0 .menu input[type=search]", "imu acceleration z")
    page.click("#chart-0 .menu input[data-name='imu.linear_acceleration.z']")
    assert chart_signals(page, 0)[-1] == "imu.linear_acceleration.z"
    page.fill("#chart-0 .menu input[type=search]", "")
    sections = page.locator("#chart-0 .menu .lists > details").count()
    topics = {signal.topic for signal in SIGNALS}
    assert sections - 1 == len(topics) <= len(STALE), "and that of derived signals"


def test_a_fixed_scale_stays(page: Any, look: Any, until: Callable[..., None]) -> None:
    page.click("#chart-0 button:has-text('Signals')")
    page.uncheck("#chart-0 .scales input[type=checkbox]")
    page.fill("#chart-0 .scales input >> nth=1", "-3")
    page.fill("#chart-0 .scales input >> nth=2", "7")
    page.keyboard.press("Tab")
    until(lambda: layout_of(page)["layout"]["charts"][0]["scales"] == {"m": [-3, 7]})


def test_layouts_are_saved_by_name_exported_and_imported(
    page: Any, look: Any, tmp_path: Path
) -> None:
    page.select_option("#charts select >> nth=1", "Motors")
    assert page.locator("#charts .chart").count() == 3
    assert chart_signals(page, 0)[0] == "thrust.front"
    page.click("#charts button:has-text('Layouts')")
    page.fill("#charts .layouts input[type=text]", "Motors")
    page.keyboard.press("Enter")
    look.text("#charts .layouts p", "Motors is built in")
    page.fill("#charts .layouts input[type=text]", "mine")
    page.keyboard.press("Enter")
    look.text("#charts .layouts p", "saved as mine")
    with page.expect_download() as download:
        page.click("#charts .layouts button:has-text('Export')")
    file = Path(download.value.path())
    assert list(json.loads(file.read_text())["layouts"]) == ["mine"]
    page.click("#charts .layouts button:has-text('Remove')")
    look.text("#charts .layouts p", "removed")
    copy = tmp_path / "layouts.json"
    copy.write_text(file.read_text().replace("thrust.front", "no.such"))
    page.set_input_files("#charts .layouts input[type=file]", str(copy))
    look.text("#charts .layouts p", "mine: there is no signal no.such here")
    copy.write_text(file.read_text())
    page.set_input_files("#charts .layouts input[type=file]", str(copy))
    look.text("#charts .layouts p", "mine imported")
    page.select_option("#charts select >> nth=1", "Attitude")
    page.select_option("#charts select >> nth=1", "mine")
    page.reload()
    page.wait_for_selector("#chart-2 .legend span")
    look.value("#charts select >> nth=1", "mine")


def test_edges_are_moved_by_keys_and_pointer_and_a_double_click_puts_them_back(page: Any) -> None:
    def sizes() -> tuple[float, float]:
        side, charts = (page.locator(one).bounding_box() for one in ("#side", "#charts"))
        return side["width"], charts["height"]

    width, height = sizes()
    page.focus(".edge.side")
    page.keyboard.press("ArrowLeft")
    page.focus(".edge.charts")
    page.keyboard.press("ArrowUp")
    assert sizes() == (width + 20, height + 20)
    box = page.locator(".edge.side").bounding_box()
    page.mouse.move(box["x"] + 3, 300)
    page.mouse.down()
    page.mouse.move(600, 300)  # over the frame of the 3D view
    page.mouse.move(10, 300)
    page.mouse.up()
    assert sizes()[0] == 1440 / 2, "never more than half of the window"
    page.reload()
    page.wait_for_selector(".edge.side", state="attached")
    assert sizes() == (1440 / 2, height + 20)
    for edge in (".edge.side", ".edge.charts"):
        page.locator(edge).dispatch_event("dblclick")
    assert sizes() == (width, height)
