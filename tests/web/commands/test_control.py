"""Control lease on the page's side: requests to the station, and who is present."""

from __future__ import annotations

from typing import Any

import pytest


@pytest.mark.parametrize("action", ["ask", "give", "keep", "release"])
def test_an_operator_asks_the_station_under_the_own_name(
    station: Any, operator: Any, action: str
) -> None:
    assert operator.post("/api/control", json={"action": action}).status_code == 200
    service, request = station.requests[-1]
    label = operator.get("/api/session").json()["label"]
    assert (service, request.action, request.requester) == ("control", action, label)


def test_only_an_admin_takes_control(station: Any, operator: Any, admin: Any) -> None:
    refused = operator.post("/api/control", json={"action": "take"})
    assert (refused.status_code, station.requests) == (403, [])
    assert "admins alone may take it" in refused.json()["error"]
    assert admin.post("/api/control", json={"action": "take"}).status_code == 200
    assert station.requests[-1][1].action == "take"


def test_what_the_station_refuses_comes_with_its_reason(station: Any, operator: Any) -> None:
    station.refusal = "ben has asked anna for control already"
    answer = operator.post("/api/control", json={"action": "ask"})
    assert (answer.status_code, answer.json()["error"]) == (409, station.refusal)


def test_no_other_word_is_an_action(station: Any, operator: Any) -> None:
    answer = operator.post("/api/control", json={"action": "steal"})
    assert (answer.status_code, station.requests) == (422, [])
    assert "'release' or 'take'" in answer.json()["error"]


def test_everybody_sees_who_has_control(station: Any, viewer: Any) -> None:
    station.control("anna", "ben", 12.4)
    shown = viewer.get("/api/summary").json()["control"]
    assert shown == {"holder": "anna", "asking": "ben", "answer_within": 12}


def test_the_station_hears_who_has_a_page_open(
    site: Any, station: Any, operator: Any, until: Any
) -> None:
    label = operator.get("/api/session").json()["label"]
    with site.websocket("/ws/events", site.cookie(operator)):
        until(lambda: label in station.present)
    until(lambda: label not in station.present)
