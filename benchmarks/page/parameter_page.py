"""The Gains tab with 300 parameters in Chromium: main-thread time for each change that arrives.

It uses the page's own modules and styles, without a server: this process answers the browser's
requests.
"""

from __future__ import annotations

import json
import mimetypes
import os
from dataclasses import asdict
from typing import Any

from benchmarks.harness import CHROMIUM, Report, Row, Size, Target
from console.parameters.station import StationTree
from quadrotor.checkout import ROOT
from quadrotor.parameters import ParameterStore
from vehicle.parameters import new_parameters

FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run"]
STATIC = ROOT / "web" / "static"
COUNT = 300
LIMIT = 2.0  # ms of the thread for one change: 4 % of it at 20 changes a second
SHARE = 0.1  # of the time to build the whole tree
START = """
import { Gains } from "/static/gains/gains.js";
const events = new EventTarget();
events.on = (type, act) => events.addEventListener(type, ({ detail }) => act(detail));
window.tell = (type, detail) => events.dispatchEvent(new CustomEvent(type, { detail }));
window.gains = new Gains(events, true);
tell("hello", {});
"""
ACTS = {
    "one change": "change(names[revision % names.length])",
    "a preset of all numbers": "names.forEach(change)",
    "built anew": "gains.build([...gains.rows.values()].map((row) => row.description))",
}
MEASURE = """([rounds, names]) => {
  window.revision ??= 1;
  const change = (name) => {
    const value = (revision % 40) / 10;
    tell("parameter", { name, value, generation: 1, revision: ++revision });
  };
  for (let k = 0; k < rounds; k++) { ACT; document.body.offsetHeight; }
}"""
PARTS = {"ScriptDuration": "script", "RecalcStyleDuration": "style", "LayoutDuration": "layout"}


def run(size: Size = Size.FULL) -> Report:
    from playwright.sync_api import sync_playwright

    rounds = size.of(2000, 200, 20)
    described = parameters()
    names = [d["name"] for d in described if d["type"] == "float"]
    report = Report(
        "parameter_page",
        f"Gains tab with {COUNT} parameters",
        [
            "Chromium without graphics card, all branches open; time of the page's main thread",
            f"{rounds} changes of {len(names)} numbers in turn, layout forced after each",
            f"load before: {os.getloadavg()[0]:.1f} of {os.cpu_count()} cores",
        ],
    )
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.route("**/*", lambda route: answer(route, described))
        page.goto("http://page.test/")
        page.wait_for_function(f"window.gains?.rows.size === {COUNT}")
        page.evaluate(
            "document.getElementById('tab-gains').hidden = false;"
            "document.querySelectorAll('#gains details').forEach((d) => (d.open = true));"
            "document.body.offsetHeight"
        )
        spent = {}
        session = page.context.new_cdp_session(page)
        session.send("Performance.setTimeDomain", {"timeDomain": "threadTicks"})
        session.send("Performance.enable")
        for label, act in ACTS.items():
            times = rounds if label == "one change" else max(1, rounds // 100)
            before = metrics(session)
            page.evaluate(MEASURE.replace("ACT", act), [times, names])
            after = metrics(session)
            part = {PARTS[k]: 1e3 * (after[k] - before[k]) / times for k in PARTS}
            spent[label] = sum(part.values())
            figures = {f"{name}, ms": value for name, value in part.items()}
            report.rows.append(Row(label, {"all, ms": spent[label], **figures}))
        browser.close()
    report.targets += [
        Target("one change, ms", spent["one change"], LIMIT),
        Target("one change over building again", spent["one change"] / spent["built anew"], SHARE),
    ]
    return report


def metrics(session: Any) -> dict[str, float]:
    return {m["name"]: m["value"] for m in session.send("Performance.getMetrics")["metrics"]}


def parameters() -> list[dict[str, Any]]:
    """Return all parameters of vehicle and station, and copies under other names up to `COUNT`."""
    trees = (new_parameters(), StationTree().model_copy(deep=True))
    real = [d for tree in trees for d in ParameterStore(tree).descriptions()]
    made = []
    for k in range(COUNT):
        d = real[k % len(real)]
        name = d.name if k < len(real) else f"copy.{d.name}"
        made.append({**asdict(d), "name": name, "value": d.default, "revision": 0})
    return made


def answer(route: Any, described: list[dict[str, Any]]) -> None:
    path = route.request.url.split("/", 3)[3].split("?")[0]
    if path == "":
        page = (STATIC / "console/index.html").read_text()
        route.fulfill(
            body=page.replace(' src="/static/console/app.js">', f">{START}"),
            content_type="text/html",
        )
    elif path == "api/parameters":
        content = {"revision": 0, "generation": 1, "parameters": described}
        route.fulfill(body=json.dumps(content), content_type="application/json")
    elif path.startswith("static/") and (STATIC / path[7:]).is_file():
        kind = mimetypes.guess_type(path)[0] or "text/plain"
        route.fulfill(path=STATIC / path[7:], content_type=kind)
    else:
        route.fulfill(status=404, body="{}", content_type="application/json")
