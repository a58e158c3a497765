"""Experiments of the Fly tab in Chromium: options, the hold that starts one, verdict, report."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from console.experiment_running.service import describe
from vehicle_link.messages import new
from vehicle_link.parameters.messages import from_parameters

RUN = "20260131T093042Z_quad1"
START, FINISH, STOP = (f"#experiment .act button >> nth={n}" for n in range(3))


@pytest.fixture
def section(
    kept_page: Any,
    flying: Any,
    station: Any,
    until: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
) -> Any:
    """Return the page with its section open, on a station that lists its experiments."""
    page = kept_page
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
    # A click would close what the flight of the test before has opened.
    page.evaluate("document.getElementById('experiment').open = true")
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


def hold(page: Any, station: Any, until: Any, count: int) -> None:
    page.locator(START).scroll_into_view_if_needed()
    page.hover(START)
    page.mouse.down()
    until(lambda: (page.wait_for_timeout(20), len(asked(station)) == count)[1])
    page.mouse.up()


def asked(station: Any) -> list[Any]:
    return [request for service, request in station.requests if service == "experiment"]


def test_a_hold_starts_the_experiment_with_its_options_and_a_click_does_not(
    section: Any, seen: Any, station: Any, until: Any
) -> None:
    section.fill("#experiment input[aria-label=duration]", "12")
    section.select_option("#experiment select[aria-label=manoeuvre]", "figure_eight")
    station.requests.clear()
    sent: list[str] = []
    section.on("request", lambda request: sent.append(request.method))
    section.click(START)
    section.evaluate("fetch('/api/session').then((answer) => answer.status)")
    assert set(sent) == {"GET"}, "a click sends nothing"
    hold(section, station, until, 1)
    [request] = asked(station)
    assert (request.action, request.name) == ("start", "bearings")
    options = from_parameters(request.options)
    assert (options["duration"], options["manoeuvre"]) == (12.0, "figure_eight")
    seen.text("#answer", "experiment: start: accepted")


def test_an_option_out_of_bounds_is_not_sent_and_a_refusal_shown(
    section: Any, seen: Any, station: Any, until: Any
) -> None:
    station.requests.clear()
    section.fill("#experiment input[aria-label=duration]", "2")
    section.hover(START)
    section.mouse.down()
    seen.text("#answer", "duration = 2; allowed 5 to 3600 s")
    section.mouse.up()
    assert asked(station) == []
    section.fill("#experiment input[aria-label=duration]", "10")
    station.refusal = "the vehicle is armed; an experiment starts on the ground"
    hold(section, station, until, 1)
    seen.text("#answer", "the vehicle is armed; an experiment starts on the ground")


def test_while_it_flies_it_can_be_finished_and_stopped(
    section: Any, seen: Any, station: Any, until: Any
) -> None:
    tell(station, name="bearings", phase="flying", step="take off", elapsed=4.0, planned=35.0)
    seen.text("#experiment .step", "take off · 00:04 of about 00:35")
    seen.text("#experiment summary output", "bearings · flying")
    assert section.is_disabled(START)
    station.requests.clear()
    section.click(FINISH)
    until(lambda: [r.action for r in asked(station)] == ["finish"])
    section.click(STOP)
    until(lambda: [r.action for r in asked(station)] == ["finish", "stop"])
    tell(station, name="bearings", phase="flying", manual=True)
    seen.text("#experiment .step", "Flown by hand")


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
    seen.text("#experiment .verdict", "^bearings: failed")
    seen.text("#experiment .figures .above", r"^position rms0\.040\.025m$")
    assert section.locator("#experiment .above").count() == 1
    with section.context.expect_page() as opened:
        section.click("#experiment .links a >> nth=0")
    shown = opened.value
    shown.wait_for_selector(".figures")
    assert shown.inner_text("h1") == "bearings: failed"
    assert "hover" in shown.inner_text("main")
    shown.goto(f"{site.base}/runs")
    shown.wait_for_selector("#list td.failed:has-text('bearings: failed')")
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
    seen.text("#experiment .verdict", "^bearings: not judged")
    seen.has_class("#experiment .verdict", "not_judged")
    seen.text("#experiment .reason", f"^{reason}$")
    with section.context.expect_page() as opened:
        section.click("#experiment .links a >> nth=0")
    shown = opened.value
    shown.wait_for_selector(f".reason:has-text('{reason}')")
    assert shown.inner_text("h1") == "bearings: not judged"
    shown.goto(f"{site.base}/runs")
    shown.wait_for_selector("#list td.not_judged:has-text('bearings: not judged')")
    shown.close()


def test_what_ended_it_is_shown_and_an_old_status_is_grey(
    section: Any, seen: Any, station: Any
) -> None:
    reason = "grace took over with start behavior"
    tell(station, name="bearings", phase="stopped", reason=reason)
    seen.text("#experiment .reason", f"^{reason}$")
    seen.has_no_class("#experiment", "old")
    station.told = None
    seen.has_class("#experiment", "old")
    assert section.is_disabled(START)


def test_a_report_that_is_not_there_says_so(page: Any, site: Any, look: Any) -> None:
    page.goto(f"{site.base}/report/unknown")
    look.text("h1", "No report")
    look.text(".reason", "no run 'unknown' in the catalogue")
