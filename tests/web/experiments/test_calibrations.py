"""Calibrations over HTTP: the vehicle's, and requests, proposals and decisions."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from vehicle_link.messages import new
from vehicle_link.parameters.messages import from_parameters


@pytest.fixture
def calibrating(helper: Any) -> Any:
    return helper("calibrating")


@pytest.fixture
def bench(station: Any, calibrating: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    for name in ("fly", "_call_blocking"):
        monkeypatch.setattr(station, name, getattr(station, name))  # restored afterwards
    yield calibrating.Bench(station)
    station._live._newest.pop("experiment_status", None)


def test_what_the_vehicle_keeps_comes_newest_first_and_judged(
    viewer: httpx.Client, bench: Any
) -> None:
    answer = viewer.get("/api/calibrations").json()
    assert answer["problem"] == ""
    assert [one["name"] for one in answer["history"]] == ["gyroscope", "mass", "accelerometer"]
    assert all(one["good"] for one in answer["history"])
    first = answer["history"][1]
    assert (first["values"], first["previous"]) == ({"model.mass": 1.308}, {"model.mass": 1.2})
    assert first["quality"][0]["good"] is True


def test_a_vehicle_that_does_not_tell_has_a_reason_and_no_history(
    operator: httpx.Client, bench: Any, calibrating: Any
) -> None:
    bench.told_history = False
    answer = operator.get("/api/calibrations")
    assert answer.status_code == 200
    assert answer.json() == {"history": None, "problem": calibrating.SILENT}
    bench.told_history, bench.station.away = True, True
    assert "cannot be reached" in operator.get("/api/calibrations").json()["problem"]


def test_experiments_say_what_they_propose_and_why_a_file_cannot_run(
    operator: httpx.Client, bench: Any, calibrating: Any
) -> None:
    found = {e["name"]: e for e in operator.get("/api/experiments").json()["experiments"]}
    proposing = {name: e["calibration"] for name, e in found.items() if e["calibration"]}
    assert proposing == calibrating.PROPOSES
    assert found["my_slip.py"]["problem"] == calibrating.BROKEN
    assert found["my_hops"]["problem"] == ""
    assert [o["name"] for o in found["accelerometer"]["options"]] == ["method", "poses", "hold"]


def test_yes_is_to_one_question_and_decisions_carry_the_operators_name(
    operator: httpx.Client, bench: Any, calibrating: Any
) -> None:
    label = operator.get("/api/session").json()["label"]
    bench.status = calibrating.ended("accelerometer", calibrating.accelerometer())
    assert operator.post("/api/experiments/confirm", json={}).status_code == 422
    body = {"question": "Are propellers off?"}
    assert operator.post("/api/experiments/confirm", json=body).status_code == 200
    assert operator.post("/api/experiments/reject", json={}).status_code == 200
    assert operator.post("/api/experiments/accept", json={}).status_code == 200
    asked = [request for service, request in bench.station.requests if service == "experiment"]
    assert [request.action for request in asked] == ["confirm", "reject", "accept"]
    assert {request.requester for request in asked} == {label}
    assert from_parameters(asked[0].options) == body
    assert operator.get("/api/calibrations").json()["history"][0]["requester"] == label


def test_the_summary_has_instruction_live_figures_and_the_proposal(
    operator: httpx.Client, bench: Any, calibrating: Any
) -> None:
    live = {"mass": (1.3, "kg"), "mass deviation": (float("inf"), "kg")}
    bench.status = calibrating.told(
        "mass",
        live,
        instruction="It hovers",
        question="Is it clear?",
        step_number=3,
        step_count=4,
        step_share=0.25,
    )
    bench.fly()
    summary = operator.get("/api/summary").json()
    shown = summary["experiment"]
    assert (shown["instruction"], shown["question"]) == ("It hovers", "Is it clear?")
    assert (shown["step_number"], shown["step_count"], shown["step_share"]) == (3, 4, 0.25)
    assert shown["live"] == [
        {"name": "mass", "value": 1.3, "unit": "kg"},
        {"name": "mass deviation", "value": None, "unit": "kg"},
    ]
    assert summary["proposal"] is None
    bench.status = calibrating.ended("motor_bench", calibrating.motor())
    bench.fly()
    proposal = operator.get("/api/summary").json()["proposal"]
    assert (proposal["name"], proposal["good"]) == ("motor", False)
    assert [one["good"] for one in proposal["quality"]] == [True, False]


@pytest.mark.parametrize("text", ["[]", "{", json.dumps({"name": "mass", "speed": 3})])
def test_a_proposal_without_sense_is_a_problem_in_one_line(
    operator: httpx.Client, station: Any, text: str
) -> None:
    status = new("quadlab_msgs/ExperimentStatus", name="mass", phase="passed", proposal=text)
    station.put("experiment_status", status)
    problem = operator.get("/api/summary").json()["proposal"]["problem"]
    assert problem.startswith("not a calibration record")
    assert "\n" not in problem
