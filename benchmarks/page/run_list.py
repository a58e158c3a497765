"""The page of runs with 2000 of them: a page of the list, and a search.

In Chromium the list is scrolled with the answers of a real catalogue, without a server.
"""

from __future__ import annotations

import json
import mimetypes
import os
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from benchmarks.harness import CHROMIUM, Report, Row, Size, Target, time_in_turns
from benchmarks.page.parameter_page import FLAGS, STATIC
from console.catalogue.catalogue import Catalogue
from console.catalogue.notes import write_notes
from console.catalogue.search import RunSearch
from console.catalogue.tables import RunEntry
from console.catalogue.tags import change_tags
from web.runs.listing import lines

COUNT = 2000
PAGE = 100
LIMIT = 50.0  # ms of a page of the list
FRAME = 16.0  # ms of the page's thread for one step of the wheel
NODES = 2500
SCROLL = """async (steps) => {
  const frame = document.querySelector(".frame"), taken = [];
  for (let k = 0; k < steps; k++) {
    frame.scrollTop = (k % 600) * 100;
    const began = performance.now();
    list.draw();
    document.body.offsetHeight;
    taken.push(performance.now() - began);
    if (k % 20 === 0) await new Promise((done) => setTimeout(done, 5));
  }
  return [taken, document.querySelectorAll("*").length];
}"""
START = """<!doctype html><link rel="stylesheet" href="/static/core/style.css">
<link rel="stylesheet" href="/static/runs/runs.css"><body class="page"><main class="page runs">
<section id="list"></section></main><script type="module">
import { RunList } from "/static/runs/list.js";
window.list = new RunList(document.getElementById("list"),
  async (offset, limit) => (await fetch(`/runs?offset=${offset}&limit=${limit}`)).json(),
  () => "");
list.reset();
</script>"""


def run(size: Size = Size.FULL) -> Report:
    report = Report(
        "run_list",
        f"List of {COUNT} runs",
        [
            f"a catalogue in SQLite, every tenth run with notes, every fifth with a tag; pages of "
            f"{PAGE}",
            "list and search: of one page with count, tags, notes, marks and verdicts",
            "scrolled: script and layout of one step by 100 px in Chromium without graphics card",
            f"load before: {os.getloadavg()[0]:.1f} of {os.cpu_count()} cores",
        ],
    )
    with tempfile.TemporaryDirectory() as folder:
        catalogue = filled(Path(folder))
        times = time_in_turns(
            {
                "first page": (lambda: page_of(catalogue, RunSearch(), 0), 3),
                "last page": (lambda: page_of(catalogue, RunSearch(), COUNT - PAGE), 3),
                "three words": (lambda: page_of(catalogue, RunSearch("gusty anna quad1"), 0), 3),
                "a tag": (lambda: page_of(catalogue, RunSearch(tag="wind"), 0), 3),
            },
            size.of(9, 3, 1),
        )
        for name, timing in times.items():
            report.rows.append(Row(name, {"ms": 1e3 * timing.median}))
        steps, nodes = scrolled(catalogue, size.of(600, 60, 5))
        catalogue.close()
    p95 = statistics.quantiles(steps, n=20)[-1]
    report.rows.append(Row("scrolled by 100 px", {"ms": statistics.median(steps), "p95 ms": p95}))
    slowest = max(1e3 * timing.median for timing in times.values())
    report.targets += [
        Target("slowest page of the list, ms", slowest, LIMIT),
        Target("one step of the wheel, median ms", statistics.median(steps), FRAME),
        Target("nodes of the document after scrolling through all", nodes, NODES),
    ]
    return report


def filled(data: Path) -> Catalogue:
    catalogue = Catalogue(data)
    now_ns = time.time_ns()
    ids = [f"run{number:05}" for number in range(COUNT)]
    with catalogue.session() as session:
        session.add_all(
            RunEntry(
                id=name,
                vehicle="quad1",
                start_ns=now_ns - number * 3_600_000_000_000,
                duration=300.0,
                file=f"{name}.mcap",
                bytes=75_000_000,
                messages=700_000,
                operator="anna" if number % 2 else "grace",
                complete=True,
                recovered=False,
                problem="",
                notes="",
            )
            for number, name in enumerate(ids)
        )
    change_tags(catalogue, ids[::5], ["wind"], [])
    for name in ids[::10]:
        write_notes(catalogue, name, "gusty near the door, new propellers", "anna")
    return catalogue


def page_of(catalogue: Catalogue, search: RunSearch, offset: int) -> dict[str, Any]:
    found = catalogue.runs(search, limit=PAGE, offset=offset)
    return {"total": catalogue.count(search), "runs": lines(catalogue, found)}


def scrolled(catalogue: Catalogue, steps: int) -> tuple[list[float], int]:
    """Return the ms of each step, and the number of nodes of the document at the end."""
    from playwright.sync_api import sync_playwright

    def answer(route: Any) -> None:
        url = urlsplit(route.request.url)
        if url.path == "/":
            route.fulfill(body=START, content_type="text/html")
        elif url.path == "/runs":
            offset = int(parse_qs(url.query)["offset"][0])
            route.fulfill(body=json.dumps(page_of(catalogue, RunSearch(), offset)))
        else:
            file = STATIC / url.path.removeprefix("/static/")
            kind = mimetypes.guess_type(file.name)[0] or "text/plain"
            route.fulfill(body=file.read_text(), content_type=kind)

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.route("**/*", answer)
        page.goto("http://page.test/")
        page.wait_for_selector("tr[data-index]")
        page.evaluate(f"for (let at = 0; at < {COUNT}; at += {PAGE}) list.more(at)")
        page.wait_for_function(f"list.runs.filter(Boolean).length === {COUNT}", timeout=120_000)
        taken, nodes = page.evaluate(SCROLL, steps)
        browser.close()
    return taken, nodes
