"""Sticks from a page in Chromium to the vehicle: latency, and time to stop when the page closes.

Real processes: station, web, Chromium. A listener in this process receives what the vehicle would
receive. The page's clock is compared with ours through the browser's debugging pipe, best of 200.
"""

from __future__ import annotations

import os
import re
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks.harness import CHROMIUM, Report, Row, Size, Target
from quadrotor.checkout import ROOT
from tests.support.subscribers import has_subscriber
from vehicle_link.topics.control_inputs import decode_joy, encode_heartbeat
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received

FLAGS = [
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--disable-gpu",
]
LIMIT_P50, LIMIT_P95, LIMIT_HOLD = 5.0, 25.0, 250.0  # ms
BOUND = 30.0  # s
STUB = """() => {
  window.pad = { id: 'benchmark', index: 0, connected: true, mapping: 'standard',
    axes: [0, 0, 0, 0], buttons: Array.from({ length: 17 }, () => ({ pressed: false })),
    get timestamp() { return performance.now(); } };
  window.plugged = true; window.isHidden = false; window.marked = 0;
  navigator.getGamepads = () => [window.plugged ? window.pad : null];
  document.hasFocus = () => true;
  Object.defineProperty(document, 'hidden', { get: () => window.isHidden, configurable: true });
  window.clock = () => performance.timeOrigin + performance.now();
  window.sentAt = []; window.back = [];
  const send = WebSocket.prototype.send;  // marks held frames by their first axis
  WebSocket.prototype.send = function (data) {
    if (data.byteLength === 28 && new DataView(data).getFloat32(16, true) > 0.5 && window.marking) {
      const mark = ++window.marked;
      new DataView(data).setFloat32(0, mark / 65536, true);
      window.sentAt[mark] = window.clock();
      window.numbers[new DataView(data).getUint32(20, true)] = mark;
      if (!this.heard) {
        this.heard = true;
        this.addEventListener('message', ({ data: answer }) => {
          const { n, by } = JSON.parse(answer), mark = window.numbers[n];
          if (by === 'station' && mark) window.back[mark] = window.clock();
        });
      }
    }
    return send.call(this, data);
  };
  window.numbers = {};
}"""
EVENTS = {
    "blur": "dispatchEvent(new Event('blur'))",
    "hidden tab": "window.isHidden = true; document.dispatchEvent(new Event('visibilitychange'))",
    "unplugged, with an event": (
        "window.plugged = false; dispatchEvent(new Event('gamepaddisconnected'))"
    ),
    "unplugged, without an event": "window.plugged = false",
    "page left": "dispatchEvent(new Event('pagehide'))",
    "page hangs": "const end = performance.now() + 600; while (performance.now() < end);",
}


class Listener:
    """A subscriber to what the vehicle would receive, with the times (ms of the system's clock)."""

    def __init__(self, port: int) -> None:
        self.session = loopback_session(port)
        self.node = Node(self.session, "/quad1", "benchmark")
        self.orders: list[tuple[float, float, bool]] = []  # ms, first axis, enabled
        self.node.subscribe("joy", TOPICS["joy"].type_name, self._on_joy, direct=True)
        heartbeat = self.node.advertise(TOPICS["vehicle_heartbeat"])
        if not has_subscriber(heartbeat, 10.0):
            raise TimeoutError("the station does not subscribe to heartbeats; is it running?")
        heartbeat.put(encode_heartbeat(1, 0))  # of a vehicle that accepts sticks from anyone

    def _on_joy(self, received: Received) -> None:
        sticks = decode_joy(received.payload)
        self.orders.append((received.received_ns * 1e-6, sticks.axes[0], sticks.enabled))

    @property
    def flies(self) -> bool:
        return bool(self.orders) and self.orders[-1][2]

    def close(self) -> None:
        self.node.close()
        self.session.close()


def run(size: Size = Size.FULL) -> Report:
    from playwright.sync_api import sync_playwright

    seconds, rounds = size.of((60, 20), (5, 5), (1, 1))
    report = Report(
        "sticks",
        "Sticks: page to station",
        [
            "Chromium, quadlab web and quadlab station, each a process of its own, one machine",
            f"latency: {seconds} s of frames at 50 Hz, from the page's send to the order on its "
            "way to the vehicle (one process further than the station); round trip: to the "
            "station's answer in the page",
            f"hold: from the event in the page to the order to stop, {rounds} times each",
            f"load before: {os.getloadavg()[0]:.1f} of {os.cpu_count()} cores",
        ],
    )
    worst: dict[str, float] = {}
    with (
        tempfile.TemporaryDirectory() as folder,
        _processes(Path(folder)) as (url, listener),
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        context = browser.new_context()
        context.route("**/viser/**", lambda route: route.fulfill(status=200, body=""))
        page = context.new_page()
        page.goto(url)
        page.wait_for_selector("#sticks .note")
        home = re.sub(r"\?.*", "", url)
        _latency(report, page, listener, seconds)
        for name, script in EVENTS.items():
            times = [_hold(page, listener, script) for _ in range(rounds)]
            worst[name] = _row(report, f"hold: {name}", times)
        closed = list[float]()
        while len(closed) < rounds:  # a busy machine may have dropped the sticks before
            page = _fresh(context, page, home)
            if (hold := _hold_of_close(page, listener)) is not None:
                closed.append(hold)
        worst["page closed"] = _row(report, "hold: page closed", closed)
        browser.close()
    report.targets += [
        Target(f"hold at most, ms: {name}", most, LIMIT_HOLD) for name, most in worst.items()
    ]
    return report


def _latency(report: Report, page: Any, listener: Listener, seconds: float) -> None:
    """Measure frames; again when a busy machine dropped the sticks before one was answered."""
    one_way, trips = list[float](), list[float]()

    def is_measured() -> bool:
        _press(page, listener)
        offset, doubt = _offset(page)
        listener.orders.clear()
        page.evaluate("window.marking = true")
        page.wait_for_timeout(1000 * seconds)
        page.evaluate("window.marking = false")
        sent, back = page.evaluate("[window.sentAt, window.back]")
        page.evaluate("window.sentAt.fill(null); window.back.fill(null)")
        orders = listener.orders
        there = {round(axis * 65536): at for at, axis, enabled in orders if enabled and axis}
        marks = [mark for mark in range(len(sent)) if mark in there and sent[mark]]
        one_way[:] = [there[mark] - offset - sent[mark] for mark in marks]
        trips[:] = [at - sent[mark] for mark, at in enumerate(back) if at and sent[mark]]
        report.notes.append(
            f"{sum(map(bool, sent))} frames sent, {len(one_way)} arrived, {len(trips)} answered; "
            f"the two clocks agree to ±{doubt:.2f} ms"
        )
        return bool(one_way and trips)

    _until(is_measured, page)
    for name, values in (("page → station → vehicle's side", one_way), ("round trip", trips)):
        _row(report, name, values)
    report.targets += [
        Target("page to station, median, ms", statistics.median(one_way), LIMIT_P50),
        Target("page to station, 95 %, ms", _quantile(one_way, 0.95), LIMIT_P95),
    ]
    page.evaluate("window.pad.buttons[4].pressed = false")
    _until(lambda: not listener.flies, page)


def _hold(page: Any, listener: Listener, script: str) -> float:
    """Return the ms from the event to the order to stop.

    It repeats when a busy machine dropped the sticks before.
    """
    while True:
        page.evaluate("window.plugged = true; window.isHidden = false;")
        offset, _ = _offset(page, 20)
        _press(page, listener)
        began = page.evaluate(f"() => {{ const now = window.clock(); {script}; return now; }}")
        _until(lambda: not listener.flies, page)
        page.evaluate("window.pad.buttons[4].pressed = false")
        if (stopped := _stop_after(listener, began + offset)) is not None:
            return stopped - offset - float(began)


def _hold_of_close(page: Any, listener: Listener) -> float | None:
    """Return how long the sticks were active after closing the page, by our own clock.

    This includes the time to reach the browser. None if the sticks had been stopped before.
    """
    _press(page, listener)
    began = time.time_ns() * 1e-6
    page.close()
    _until(lambda: not listener.flies)
    stopped = _stop_after(listener, began)
    return stopped - began if stopped is not None else None


def _stop_after(listener: Listener, at: float) -> float | None:
    """Return when the order to stop arrived; None if the sticks had been stopped before."""
    before = [enabled for came, _, enabled in listener.orders if came < at]
    if not before or not before[-1]:
        return None
    return next(came for came, _, enabled in listener.orders if came >= at and not enabled)


def _fresh(context: Any, page: Any, home: str) -> Any:
    if not page.is_closed():
        page.close()
    made = context.new_page()
    made.goto(home)
    made.wait_for_selector("#sticks .note")
    return made


def _press(page: Any, listener: Listener) -> None:
    """Press until the sticks are active; again if a busy machine dropped them."""
    if not page.evaluate("'pad' in window"):
        page.evaluate(STUB)

    def flies() -> bool:
        for pressed in ("false", "true"):
            page.evaluate(f"window.pad.buttons[4].pressed = {pressed}")
            page.wait_for_timeout(80)
        return listener.flies

    _until(flies, page)


def _offset(page: Any, tries: int = 200) -> tuple[float, float]:
    """Return the ms by which the system's clock is ahead of the page's, and the uncertainty."""
    best = (float("inf"), 0.0)
    for _ in range(tries):
        before = time.time_ns() * 1e-6
        there = page.evaluate("window.clock()")
        after = time.time_ns() * 1e-6
        best = min(best, ((after - before) / 2, (before + after) / 2 - there))
    return best[1], best[0]


def _until(condition: Callable[[], bool], page: Any = None) -> None:
    end = time.monotonic() + BOUND
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError("the sticks did not do what was waited for; is the machine stuck?")
        if page is None:
            time.sleep(0.01)
        else:
            page.wait_for_timeout(10)


def _quantile(values: list[float], share: float) -> float:
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


def _row(report: Report, name: str, values: list[float]) -> float:
    """Add a row, and return the largest value."""
    report.rows.append(
        Row(
            name,
            {
                "median, ms": round(statistics.median(values), 2),
                "95 %, ms": round(_quantile(values, 0.95), 2),
                "most, ms": round(max(values), 2),
                "n": float(len(values)),
            },
        )
    )
    return max(values)


@contextmanager
def _processes(folder: Path) -> Iterator[tuple[str, Listener]]:
    """Yield the sign-in link of a station with a web process, and a listener."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    common = ["--data", str(folder), "--loopback-port", str(port)]
    running = []
    try:
        running.append(_start("station", *common, "--vehicle", "127.0.0.1:9"))
        _read(running[0], "serves")
        listener = Listener(port)
        running.append(_start("web", *common, "--port", "0"))
        url = re.search(r"http\S+", _read(running[1], "http"))
        assert url is not None
        yield url[0], listener
        listener.close()
    finally:
        for process in reversed(running):
            process.terminate()
            process.wait(30)


def _start(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "quadlab", *arguments],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"},
    )


def _read(process: subprocess.Popen[str], word: str) -> str:
    assert process.stdout is not None
    for line in process.stdout:
        if word in line:
            return line
    raise RuntimeError(f"a process ended without saying {word!r}")
