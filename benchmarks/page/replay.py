"""Replay of a run of 20 minutes in a real browser: seek, first picture, memory of the web process.

A seek is from the browser's pointer event on the scrub bar until 3D view, charts (at the screen's
resolution) and values show that instant and the browser has painted them.
"""

from __future__ import annotations

import contextlib
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import httpx

from benchmarks.harness import CHROMIUM, Report, Row, Size, Target
from benchmarks.logs.recorded_run import MadeRun, write_run

FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]
"""Flags for Chromium without GPU: the page needs no WebGL, and an emulated GPU is many times slower
than the processor itself."""
SERVER = """
import sys
from pathlib import Path
from console.catalogue.catalogue import Catalogue
from console.runs.adoption import tidy_runs
from web.process import run_web
data = Path(sys.argv[1])
tidy_runs(Catalogue(data))
run_web(data, port=0, loopback_port=int(sys.argv[2]))
"""
DEAD_PORT = 9  # discard: no station runs there, and the page does not need one
LIMIT = 0.2  # s
ROOM = 300.0  # MB
SEEKS = """async (shares) => {
  const bar = document.querySelector('#line .bar'), main = document.querySelector('main');
  const took = [], box = bar.getBoundingClientRect(), y = box.top + 9;
  const send = (kind, x) => bar.dispatchEvent(
    new PointerEvent(kind, { clientX: x, clientY: y, pointerId: 1, bubbles: true }));
  bar.setPointerCapture = () => {};
  const shown = (t) => new Promise((done) => {
    const watch = new MutationObserver(look), late = setTimeout(end, 10000);
    function end() { watch.disconnect(); clearTimeout(late); done(); }
    function look() { if (main.dataset.shown === t) end(); }
    watch.observe(main, { attributes: true });
    look();
  });
  const painted = () => new Promise((done) => requestAnimationFrame(() => setTimeout(done, 0)));
  send('pointerdown', box.left + 1);
  await painted();
  for (const share of shares) {
    delete main.dataset.shown;
    const began = performance.now();
    send('pointermove', box.left + share * box.width);
    await shown(Number(bar.getAttribute('aria-valuenow')).toFixed(3));
    await painted();
    took.push(performance.now() - began);
  }
  send('pointerup', box.left);
  return took;
}"""


def run(size: Size = Size.FULL) -> Report:
    """Measure the replay page; the targets are a seek of 200 ms p95, and 300 MB more at most."""
    from playwright.sync_api import sync_playwright

    duration, seeks = size.of((1200.0, 150), (120.0, 40), (20.0, 3))
    report = Report(
        "replay",
        "Replay in the browser",
        [
            f"{duration:.0f} s of a made-up run with the station's schemas and rates "
            "(benchmarks/logs/recorded_run.py); two of them over each other in the last row",
            "seek: from the pointer event until 3D, charts and values are painted at the new "
            "instant; headless Chromium on the same machine, 1440 x 900, 6 + 3 signals",
            "MB: resident memory of the web process above what it had before the first replay",
        ],
    )
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder)
        marks = [(0.3 * duration, "gust")]
        for k in range(2):
            made = MadeRun(duration, marks=marks, late=2.0 * k)
            write_run(data / "runs" / f"2026013{k}T093042Z_quad1.mcap", made, seed=k)
        size = (data / "runs" / "20260130T093042Z_quad1.mcap").stat().st_size
        report.conditions.append(f"{size / 1e6:.0f} MB a log")
        server = subprocess.Popen(
            [sys.executable, "-c", SERVER, str(data), str(DEAD_PORT)],
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert server.stdout is not None
            url = next(line for line in server.stdout if "http" in line).split()[-1]
            threading.Thread(target=server.stdout.read, daemon=True).start()
            with sync_playwright() as playwright:
                browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
                page = browser.new_page(viewport={"width": 1440, "height": 900})
                page.goto(url)
                page.wait_for_selector("#behaviors", timeout=60_000)
                _measure(report, page, url.split("/?")[0], server.pid, seeks)
                browser.close()
        finally:
            server.terminate()
            server.wait(20.0)
    return report


def _measure(report: Report, page: Any, base: str, pid: int, count: int) -> None:
    first, second = "20260130T093042Z_quad1", "20260131T093042Z_quad1"
    shares = [((k * 0.6180339887) % 1.0) * 0.98 + 0.01 for k in range(count)]
    page.wait_for_timeout(1000)
    before = memory(pid)
    watch = _Watch(base, page)
    began = time.perf_counter()
    open_replay(page, f"{base}/replay/{first}")
    built = time.perf_counter() - began
    began = time.perf_counter()
    open_replay(page, f"{base}/replay/{first}")
    opened = time.perf_counter() - began
    worst = watch.stop()
    report.rows.append(Row("first picture, log read for the first time", {"p50, ms": 1e3 * built}))
    report.rows.append(Row("first picture, again", {"p50, ms": 1e3 * opened}))
    for label, query in (
        ("seek, charts show all", f"{first}#t=1"),
        ("seek, charts show 60 s", f"{first}#t=1&w=60"),
        ("seek, charts show 10 s", f"{first}#t=1&w=10"),
        ("seek, two runs, charts show 10 s", f"{first}?with={second}#t=1&w=10"),
    ):
        page.goto("about:blank")
        open_replay(page, f"{base}/replay/{query}")
        busy = [processor(pid), processor(None)]
        took = page.evaluate(SEEKS, shares)
        busy = [processor(pid) - busy[0], processor(None) - busy[1]]
        p95 = sorted(took)[int(0.95 * len(took))]
        more = memory(pid) - before
        figures = {
            "p50, ms": statistics.median(took),
            "p95, ms": p95,
            "worst, ms": max(took),
            "web process busy, ms": 1e3 * busy[0] / count,
            "browser busy, ms": 1e3 * busy[1] / count,
            "MB more": more,
        }
        report.rows.append(Row(label, dict(figures)))
        report.targets.append(Target(f"{label}, p95 in s", 1e-3 * p95, LIMIT))
    report.targets.append(Target("memory of the web process, MB more", memory(pid) - before, ROOM))
    what = "longest answer of the page's API while a log is read, s"
    report.targets.append(Target(what, worst, 0.5))
    heap = page.evaluate("() => performance.memory.usedJSHeapSize / 1e6")
    text = f"web process before: {before:.0f} MB; heap of the page at the end: {heap:.0f} MB"
    report.notes.append(text)


def open_replay(page: Any, url: str) -> None:
    page.goto(url)
    page.wait_for_selector("main[data-shown]", timeout=300_000)


def memory(pid: int) -> float:
    """Return the resident memory of a process, MB."""
    text = Path(f"/proc/{pid}/status").read_text()
    return float(next(row for row in text.splitlines() if row.startswith("VmRSS")).split()[1]) / 1e3


def processor(pid: int | None) -> float:
    """Return processor time, s, of a process; None: of all descendants but the web process."""
    times, parents = {}, {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:  # it has ended
            continue
        times[int(stat.parent.name)] = (int(fields[11]) + int(fields[12])) / os.sysconf(
            "SC_CLK_TCK"
        )
        parents[int(stat.parent.name)] = int(fields[1])
    if pid is not None:
        return times[pid]

    def is_browser(one: int) -> bool:
        line = [one]
        while line[-1] in parents:
            line.append(parents[line[-1]])
        names = Path(f"/proc/{one}/cmdline")
        return os.getpid() in line and names.exists() and "chromium" in names.read_text()

    return sum(t for one, t in times.items() if is_browser(one))


class _Watch:
    """Client that polls the API: its longest answer shows whether the event loop was blocked."""

    def __init__(self, base: str, page: Any) -> None:
        cookies = {one["name"]: one["value"] for one in page.context.cookies()}
        self._client = httpx.Client(base_url=base, cookies=cookies, timeout=30.0)
        self._going, self._worst = threading.Event(), 0.0
        self._going.set()
        self._thread = threading.Thread(target=self._ask, daemon=True)
        self._thread.start()

    def stop(self) -> float:
        """Stop and return the longest answer, s."""
        self._going.clear()
        self._thread.join()
        return self._worst

    def _ask(self) -> None:
        while self._going.is_set():
            began = time.perf_counter()
            with contextlib.suppress(httpx.TransportError):
                self._client.get("/api/summary")
            self._worst = max(self._worst, time.perf_counter() - began)
            time.sleep(0.02)
