"""Experiments and reports over HTTP, on a scripted station."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from console.experiment_running.service import describe
from vehicle_link.messages import new
from vehicle_link.parameters.messages import from_parameters

RUN = "20260131T093042Z_quad1"
PNG = b"\x89PNG\r\n\x1a\nnot much of a picture"
RESULT = {
    "experiment": "bearings",
    "run_id": RUN,
    "options": {"duration": 10.0},
    "verdict": "passed",
    "metrics": {"position_rms_m": 0.02},
    "limits": {"position_rms_m": 0.025},
    "files": [f"{RUN}.png"],
    "problem": "",
}


@pytest.fixture
def describing(station: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a station with the real description of its experiments."""
    plain = station._call_blocking

    def call(service: str, request: Any) -> Any:
        if service == "experiment" and request.action == "describe" and not station.away:
            return describe("quad1", [])
        return plain(service, request)

    monkeypatch.setattr(station, "_call_blocking", call)
    return station


@pytest.fixture
def report(site: Any) -> Iterator[Path]:
    folder = Path(site.data) / "runs" / f"{RUN}_report"
    folder.mkdir()
    (folder / "result.json").write_text(json.dumps(RESULT))
    (folder / f"{RUN}.png").write_bytes(PNG)
    (folder / "page.html").write_text("<script>alert(1)</script>")
    (folder / "page.svg").write_text("<svg/>")
    yield folder
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()


def test_experiments_come_with_their_options_and_status(
    operator: httpx.Client, describing: Any
) -> None:
    answer = operator.get("/api/experiments")
    assert answer.status_code == 200, answer.text
    found = {e["name"]: e for e in answer.json()["experiments"]}
    assert {"hover", "figure_eight", "bearings", "accelerometer", "motor_bench"} <= set(found)
    assert (found["bearings"]["calibration"], found["motor_bench"]["calibration"]) == ("", "motor")
    assert found["hover"]["options"] == []
    options = {o["name"]: o for o in found["bearings"]["options"]}
    assert (options["duration"]["minimum"], options["duration"]["unit"]) == (5.0, "s")
    assert options["manoeuvre"]["choices"] == ["hover", "figure_eight", "sticks", "manual"]
    describing.put(
        "experiment_status",
        new(
            "quadlab_msgs/ExperimentStatus",
            name="bearings",
            phase="passed",
            run_id=RUN,
            metric_names=["a", "b"],
            metric_values=[1.0, float("nan")],
            metric_limits=[2.0, float("nan")],
            reports=["x.png"],
        ),
    )
    status = operator.get("/api/summary").json()["experiment"]
    assert (status["phase"], status["run_id"], status["reports"]) == ("passed", RUN, ["x.png"])
    assert status["metrics"] == [
        {"name": "a", "value": 1.0, "limit": 2.0},
        {"name": "b", "value": None, "limit": None},
    ]


def test_each_experiment_has_its_newest_result_read_anew_after_a_judgement(
    operator: httpx.Client, report: Path
) -> None:
    def found() -> Any:
        return operator.get("/api/experiments/results").json()

    assert found().keys() == {"bearings"}
    one = found()["bearings"]
    assert (one["run"], one["verdict"]) == (RUN, "passed")
    assert one["metrics"] == [{"name": "position_rms_m", "value": 0.02, "limit": 0.025}]
    odd = {"experiment": "hover", "verdict": "failed", "metrics": {"a": None, "b": 1}, "limits": 3}
    (report / "result.json").write_text(json.dumps(odd))
    assert found()["hover"]["metrics"] == [
        {"name": "a", "value": None, "limit": None},
        {"name": "b", "value": 1.0, "limit": None},
    ]
    (report / "result.json").write_text("{")
    assert found() == {}


def test_start_finish_and_stop_reach_the_station_in_the_operators_name(
    operator: httpx.Client, station: Any
) -> None:
    label = operator.get("/api/session").json()["label"]
    body = {"name": "bearings", "options": {"duration": 10, "manoeuvre": "hover"}}
    assert operator.post("/api/experiments/start", json=body).status_code == 200
    assert operator.post("/api/experiments/finish", json={}).status_code == 200
    assert operator.post("/api/experiments/stop", json={"request_id": "r1"}).status_code == 200
    asked = [request for service, request in station.requests if service == "experiment"]
    assert [request.action for request in asked] == ["start", "finish", "stop"]
    assert {request.requester for request in asked} == {label}
    assert asked[0].name == "bearings"
    assert from_parameters(asked[0].options) == body["options"]
    assert asked[2].request_id == "r1"


def test_a_refusal_is_one_line_with_the_stations_reason(
    operator: httpx.Client, station: Any
) -> None:
    station.refusal = "duration = 1 is out of bounds; allowed 5 to 3600 s, default 60.0"
    answer = operator.post("/api/experiments/start", json={"name": "bearings"})
    assert (answer.status_code, answer.json()["error"]) == (409, station.refusal)
    station.refusal, station.away = "", True
    answer = operator.get("/api/experiments")
    assert answer.status_code == 503
    assert "cannot be reached" in answer.json()["error"]


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"name": ""},
        {"name": "bearings", "options": {"a": [1]}},
        {"name": "bearings", "speed": 3},
        {"name": "x", "options": {"a": None}},
    ],
)
def test_what_is_no_start_is_refused_here(
    operator: httpx.Client, station: Any, body: dict[str, Any]
) -> None:
    answer = operator.post("/api/experiments/start", json=body)
    assert answer.status_code == 422
    assert "\n" not in answer.json()["error"]
    assert station.requests == []


def test_a_viewer_watches_only(viewer: httpx.Client, station: Any, report: Path) -> None:
    for action, body in (("start", {"name": "hover"}), ("finish", {}), ("stop", {})):
        assert viewer.post(f"/api/experiments/{action}", json=body).status_code == 403
    assert [r for s, r in station.requests if s == "experiment"] == []
    assert viewer.get(f"/api/runs/{RUN}/report").status_code == 200


def test_a_report_is_found_by_its_run(operator: httpx.Client, report: Path) -> None:
    assert operator.get(f"/api/runs/{RUN}/report").json() == RESULT
    picture = operator.get(f"/api/runs/{RUN}/report/{RUN}.png")
    assert (picture.content, picture.headers["content-type"]) == (PNG, "image/png")
    document = operator.get(f"/api/runs/{RUN}/report/page.html")
    assert document.headers["content-type"].startswith("text/html")
    policy = document.headers.get_list("content-security-policy")
    assert len(policy) == 1
    assert policy[0].startswith("sandbox; default-src 'none'"), "it runs and fetches nothing"
    foreign = operator.get(f"/api/runs/{RUN}/report/page.svg")
    assert foreign.headers["content-type"] == "application/octet-stream"
    assert foreign.headers["content-disposition"].startswith("attachment")
    page = operator.get(f"/report/{RUN}")
    assert page.status_code == 200
    assert "report.js" in page.text
    runs = {run["id"]: run["report"] for run in operator.get("/api/runs").json()}
    assert runs == {RUN: True, "elsewhere": False}


@pytest.mark.parametrize(
    "name",
    [
        "none.png",
        "..",
        "%2e%2e",
        "..%2f..%2fweb%2fdoor.json",
        "%2fetc%2fpasswd",
        f"..%2f{RUN}.mcap",
    ],
)
def test_no_name_leads_out_of_the_report(operator: httpx.Client, report: Path, name: str) -> None:
    answer = operator.get(f"/api/runs/{RUN}/report/{name}")
    assert answer.status_code == 404, answer.text
    assert "\n" not in answer.json()["error"]


@pytest.mark.parametrize("run", ["unknown", "..", "elsewhere", "%2e%2e%2fweb"])
def test_an_unknown_run_has_no_report(operator: httpx.Client, run: str) -> None:
    for path in (f"/api/runs/{run}/report", f"/api/runs/{run}/report/x.png"):
        answer = operator.get(path)
        assert answer.status_code == 404
        assert "\n" not in answer.json()["error"]


def test_a_run_that_was_not_judged_says_so(operator: httpx.Client) -> None:
    answer = operator.get(f"/api/runs/{RUN}/report")
    assert answer.status_code == 404
    assert "no experiment was judged" in answer.json()["error"]
