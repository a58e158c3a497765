"""Commands reach the station with their requester; every answer is one clear line."""

from __future__ import annotations

from typing import Any

import httpx
import pytest

from quadrotor.errors import NoAnswerError
from vehicle_link.parameters.messages import from_parameters

COMMANDS = [
    ("arm", {}, {}),
    ("disarm", {}, {}),
    ("emergency", {"action": "land"}, {"action": "land"}),
    ("emergency", {"action": "cut"}, {"action": "cut"}),
    ("record", {"start": True}, {"start": True}),
    ("simulation", {"action": "swap_battery"}, {"action": "swap_battery"}),
    ("simulation", {"action": "reset"}, {"action": "reset"}),
]


@pytest.mark.parametrize(("name", "body", "sent"), COMMANDS)
def test_a_command_is_forwarded_with_its_requester(
    operator: httpx.Client, station: Any, name: str, body: Any, sent: dict[str, Any]
) -> None:
    answer = operator.post(f"/api/commands/{name}", json=body)
    assert answer.status_code == 200
    assert answer.json()["accepted"] is True
    ((service, request),) = station.requests
    assert service == name
    assert request.requester == operator.get("/api/session").json()["label"]
    assert len(request.request_id) == 32
    assert {key: getattr(request, key) for key in sent} == sent


def test_a_behavior_takes_typed_arguments(operator: httpx.Client, station: Any) -> None:
    arguments = {"trajectory": "figure_eight", "laps": 3, "period": 8.5, "quick": True}
    body = {"name": "follow_trajectory", "arguments": arguments}
    assert operator.post("/api/commands/start_behavior", json=body).status_code == 200
    ((_, request),) = station.requests
    assert request.name == "follow_trajectory"
    assert from_parameters(request.arguments) == arguments
    assert [type(v) for v in from_parameters(request.arguments).values()] == [str, int, float, bool]


def test_a_page_may_repeat_a_command_under_one_id(operator: httpx.Client, station: Any) -> None:
    for _ in range(2):
        operator.post("/api/commands/arm", json={"request_id": "once"})
    assert [request.request_id for _, request in station.requests] == ["once", "once"]


def test_a_refusal_comes_back_with_its_reason(operator: httpx.Client, station: Any) -> None:
    station.refusal = "battery at 13.2 V; arming needs 13.8 V"
    answer = operator.post("/api/commands/arm", json={})
    assert answer.status_code == 409
    assert answer.json() == {"error": "battery at 13.2 V; arming needs 13.8 V"}


def test_an_absent_station_is_said(operator: httpx.Client, station: Any) -> None:
    station.away = True
    answer = operator.post("/api/commands/arm", json={})
    assert answer.status_code == 503
    assert answer.json()["error"] == str(station.silence)


def test_no_answer_in_time_is_another_status_than_nobody_there(
    operator: httpx.Client, station: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(station, "silence", NoAnswerError("the vehicle has not answered"))
    station.away = True
    answer = operator.post("/api/commands/arm", json={})
    assert answer.status_code == 504


def test_an_emergency_gets_through_while_other_commands_hang(
    operator: httpx.Client, station: Any
) -> None:
    """All threads for calls are blocked by a station that does not answer."""
    import threading

    station.answering.clear()
    blocked = [
        threading.Thread(target=operator.post, args=("/api/commands/arm",), kwargs={"json": {}})
        for _ in range(20)
    ]
    emergency = threading.Thread(
        target=operator.post, args=("/api/commands/emergency",), kwargs={"json": {"action": "cut"}}
    )
    try:
        for thread in blocked:
            thread.start()
        until_count(station, "arm", 10)
        emergency.start()
        until_count(station, "emergency", 1)
    finally:
        station.answering.set()
        for thread in (*blocked, emergency):
            thread.join()


def until_count(station: Any, service: str, count: int) -> None:
    import time

    end = time.monotonic() + 20.0
    while sum(name == service for name, _ in station.requests) < count:
        assert time.monotonic() < end, f"{service} never reached the station"
        time.sleep(0.01)


@pytest.mark.parametrize(
    ("path", "body", "text"),
    [
        ("emergency", {"action": "explode"}, "action"),
        ("emergency", {}, "action: Field required"),
        ("record", {"start": "perhaps"}, "start"),
        ("start_behavior", {"name": ""}, "name"),
        ("start_behavior", {"name": "fly_to", "arguments": {"x": [1]}}, "arguments.x"),
        ("arm", {"who": "me"}, "who"),
        ("arm", [1], "body"),
    ],
)
def test_a_bad_body_is_refused_in_one_line(
    operator: httpx.Client, station: Any, path: str, body: Any, text: str
) -> None:
    answer = operator.post(f"/api/commands/{path}", json=body)
    assert answer.status_code == 422
    assert text in answer.json()["error"]
    assert "\n" not in answer.json()["error"]
    assert station.requests == []


@pytest.mark.parametrize("path", ["/api/commands/fly", "/nothing", "/api/"])
def test_an_unknown_path_is_said_as_json(operator: httpx.Client, path: str) -> None:
    answer = operator.get(path)
    assert answer.status_code == 404
    assert path in answer.json()["error"]


def test_the_api_describes_itself(operator: httpx.Client) -> None:
    paths = operator.get("/api/openapi.json").json()["paths"]
    assert {"/api/session", "/api/runs", "/api/parameters", "/api/commands/arm"} <= paths.keys()
