"""The Experiments tab: cards, options, the hold that starts one, verdict, report."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from console.experiment_running.service import describe
from vehicle_link.messages import new
from vehicle_link.parameters.messages import from_parameters

START, FINISH, STOP = (f"#experiment .act .{name}" for name in ("start", "finish", "stop"))


@pytest.fixture
def section(
    kept_page: Any,
    flying: Any,
    station: Any,
    until: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
) -> Any:
    """Return the page with its Experiments tab open, on a station that lists its experiments."""
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
    page.click("[data-tab=experiments]")
    page.click("#experiment .card .head:has-text('Bearings')")
    page.wait_for_selector("#experiment .options input")
    until(lambda: page.is_enabled(START))  # earlier, a press has no effect
    return page


@pytest.fixture
def seen(section: Any, look_at: Any) -> Any:
    return look_at(section)


def tell(station: Any, **fields: Any) -> None:
    """Let the station publish these fields repeatedly from now on."""
    station.told = fields


def hold(page: Any, station: Any, until: Any, count: int) -> None:
    page.hover(START)
    page.mouse.down()
    until(lambda: len(asked(station)) == count)
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
    seen.text("#answer", "^Experiment started$")


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
    seen.text("#experiment .now output", "bearings · flying")
    assert section.is_disabled(START)
    station.requests.clear()
    section.click(FINISH)
    until(lambda: [r.action for r in asked(station)] == ["finish"])
    section.click(STOP)
    until(lambda: [r.action for r in asked(station)] == ["finish", "stop"])
    tell(station, name="bearings", phase="flying", manual=True)
    seen.text("#experiment .step", "Flown by hand")


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
