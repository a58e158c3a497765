"""The Experiments tab in Chromium: options, the hold that starts one, verdict, report."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from console.experiment_running.service import describe
from vehicle_link.messages import new

RUN = "20260131T093042Z_quad1"
START, FINISH, STOP = (f"#experiment .act .{name}" for name in ("start", "finish", "stop"))


COUNT = """() => {
  window.presses = 0;
  addEventListener("pointerdown", () => window.presses++, true);
}"""


@pytest.fixture
def listing(station: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the station list its experiments, and tell what `tell` set last."""
    plain = station._call_blocking

    def call(service: str, request: Any) -> Any:
        if service == "experiment" and request.action == "describe":
            return describe("quad1", [])
        return plain(service, request)

    fly = station.fly

    def fly_and_tell() -> None:
        fly()
        told = station.told
        if told is not None:
            station.put("experiment_status", new("quadlab_msgs/ExperimentStatus", **told))

    monkeypatch.setattr(station, "_call_blocking", call)
    monkeypatch.setattr(station, "told", {"phase": "idle"})
    monkeypatch.setattr(station, "fly", fly_and_tell)


@pytest.fixture
def section(kept_page: Any, listing: None, flying: Any, until: Callable[..., None]) -> Any:
    """Return the page with its Experiments tab open."""
    page = kept_page
    page.click("[data-tab=experiments]")
    page.click("#experiment .card .head:has-text('Bearings')")
    page.wait_for_selector("#experiment .options input")
    until(lambda: page.is_enabled(START))  # earlier, a press has no effect
    return page


@pytest.fixture
def seen(section: Any, look_at: Any) -> Any:
    return look_at(section)


@pytest.fixture
def report(site: Any) -> Iterator[Path]:
    folder = Path(site.data) / "runs" / f"{RUN}_report"
    folder.mkdir()
    (folder / "result.json").write_text(
        json.dumps(
            {
                "experiment": "bearings",
                "run_id": RUN,
                "options": {"manoeuvre": "hover"},
                "verdict": "failed",
                "metrics": {"position_rms_m": 0.04},
                "files": [],
                "problem": "",
                "limits": {"position_rms_m": 0.025},
            }
        )
    )
    yield folder
    (folder / "result.json").unlink()
    folder.rmdir()


def tell(station: Any, **fields: Any) -> None:
    """Let the station publish these fields repeatedly from now on."""
    station.told = fields


def test_the_verdict_has_its_figures_and_leads_to_the_report(
    section: Any, seen: Any, station: Any, report: Path, site: Any
) -> None:
    tell(
        station,
        name="bearings",
        phase="failed",
        verdict="failed",
        run_id=RUN,
        metric_names=["position_rms_m", "samples"],
        metric_values=[0.04, 700.0],
        metric_limits=[0.025, float("nan")],
    )
    seen.text("#experiment .verdict .chip", "^failed 40 mm$")
    told = section.locator(START).evaluate("one => getComputedStyle(one, '::before').content")
    assert told.startswith('"hold"')
    seen.text("#experiment .card.open .last .chip", "^failed 40 mm$")
    seen.text("#experiment .figures .above", r"^position rms4025mm$")
    assert section.locator("#experiment .above").count() == 1
    with section.context.expect_page() as opened:
        section.click("#experiment .result .links a >> nth=0")
    shown = opened.value
    shown.wait_for_selector(".figures")
    assert shown.inner_text("h1") == "bearings: failed"
    assert "hover" in shown.inner_text("main")
    shown.goto(f"{site.base}/runs")
    shown.wait_for_selector("#list td.verdict[title='bearings: failed'] .chip.failed")
    shown.wait_for_selector("#detail a:has-text('Report')")
    shown.close()


def test_a_run_that_is_not_judged_says_so_everywhere_and_why(
    section: Any, seen: Any, station: Any, report: Path, site: Any
) -> None:
    reason = "no limit for position_rms_m"
    result = json.loads((report / "result.json").read_text())
    result |= {"verdict": "not_judged", "reason": reason, "limits": {}}
    (report / "result.json").write_text(json.dumps(result))
    tell(
        station,
        name="bearings",
        phase="not_judged",
        verdict="not_judged",
        run_id=RUN,
        reason=reason,
        metric_names=["position_rms_m"],
        metric_values=[0.04],
        metric_limits=[float("nan")],
    )
    seen.text("#experiment .verdict", "^bearingsnot judged 40 mm")
    seen.has_class("#experiment .verdict", "not_judged")
    seen.text("#experiment .reason", f"^{reason}$")
    with section.context.expect_page() as opened:
        section.click("#experiment .result .links a >> nth=0")
    shown = opened.value
    shown.wait_for_selector(f".reason:has-text('{reason}')")
    assert shown.inner_text("h1") == "bearings: not judged"
    shown.goto(f"{site.base}/runs")
    shown.wait_for_selector("#list td.verdict[title='bearings: not judged'] .chip.not_judged")
    shown.close()


def test_a_closed_card_opens_wherever_it_is_pressed(section: Any) -> None:
    card = section.locator("#experiment .card:has-text('Look around')")
    box = card.bounding_box()
    card.click(position={"x": box["width"] / 2, "y": box["height"] - 6})
    section.wait_for_selector("#experiment .card.open:has-text('Look around') .start")


def test_from_the_printed_link_to_a_report_takes_six_clicks(
    listing: None, flying: Any, open_page: Any, site: Any, station: Any, look_at: Any, report: Path
) -> None:
    page = open_page(site)
    page.evaluate(COUNT)
    page.click("#help-panel button:has-text('Close')")
    page.click("[data-tab=experiments]")
    page.click("#experiment .card:has-text('Figure 8')")
    started = len(station.requests)
    look_at(page).hold(START, lambda: len(station.requests) > started)
    told = {"metric_names": ["position_rms_m"], "metric_values": [0.04], "metric_limits": [0.05]}
    tell(station, name="figure_eight", phase="passed", verdict="passed", run_id=RUN, **told)
    with page.context.expect_page() as opened:
        page.click("#experiment .result .links a >> nth=0")
    opened.value.wait_for_selector(".figures")
    assert page.evaluate("presses") <= 6
