"""Emergencies by the pages' forms, for a page whose scripts have not started."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from vehicle_link.messages import header, new
from web.static_files import STATIC

PAGES = {"/": "", "/kill": "", "/runs": "", "/setup": "", "/replay/20260131T093042Z_quad1": "../"}


def actions(station: Any) -> list[str]:
    return [request.action for name, request in station.requests if name == "emergency"]


def press(client: httpx.Client, action: str, **more: str) -> httpx.Response:
    return client.post("/emergency", data={"action": action, **more}, follow_redirects=True)


@pytest.fixture(autouse=True)
def in_flight(station: Any) -> Iterator[None]:
    flies = new("quadlab_msgs/VehicleStatus", header=header(1), mode="armed", armed=True)
    station.put("status", flies)
    yield
    station.put("status", new("quadlab_msgs/VehicleStatus", header=header(1), mode="ready"))


@pytest.mark.parametrize("path", list(PAGES))
def test_each_page_has_a_form_for_both(operator: httpx.Client, path: str) -> None:
    text = operator.get(path).text
    form = re.search(r'<form [^>]*method="post" action="([^"]+)">(.*?)</form>', text, re.DOTALL)
    assert form is not None
    assert form[1] == f"{PAGES[path]}emergency"
    assert set(re.findall(r'name="action" value="(\w+)"', form[2])) == {"land", "cut"}


def test_a_landing_is_asked_for_at_once_and_told_until_it_is_acknowledged(
    operator: httpx.Client, station: Any, until: Any
) -> None:
    answer = press(operator, "land")
    assert (answer.status_code, answer.url.path) == (200, "/emergency")
    assert "accepted, not yet shown by the vehicle" in answer.text
    assert 'http-equiv="refresh"' in answer.text
    assert '<a href="./">' in answer.text
    assert actions(station) == ["land"]
    station.put("status", new("quadlab_msgs/VehicleStatus", header=header(1), mode="ready"))
    until(lambda: "acknowledged after" in operator.get("/emergency").text)
    assert "refresh" not in operator.get("/emergency").text
    assert actions(station) == ["land"], "looking again presses nothing"


def test_a_cut_is_asked_for_once_more(operator: httpx.Client, station: Any) -> None:
    asked = press(operator, "cut")
    assert (asked.status_code, actions(station)) == (200, [])
    assert "It falls." in asked.text
    assert 'name="sure" value="yes"' in asked.text
    assert press(operator, "cut", sure="yes").status_code == 200
    assert actions(station) == ["cut"]


def test_a_refusal_is_told_with_its_reason(operator: httpx.Client, station: Any) -> None:
    station.refusal = "the motors <are> off"
    answer = press(operator, "land")
    assert answer.status_code == 409
    assert "failed: the motors &lt;are&gt; off. Press again." in answer.text


def test_a_viewer_lands_but_does_not_cut(viewer: httpx.Client, station: Any) -> None:
    assert 'value="cut"' not in viewer.get("/emergency").text
    assert press(viewer, "cut", sure="yes").status_code == 403
    assert actions(station) == []
    assert press(viewer, "land").status_code == 200
    assert actions(station) == ["land"]


def test_other_sites_other_words_and_strangers_do_nothing(
    site: Any, operator: httpx.Client, station: Any
) -> None:
    data = {"action": "land"}
    foreign = operator.post("/emergency", data=data, headers={"Origin": "http://evil.example"})
    assert foreign.status_code == 403
    assert press(operator, "fly").status_code == 422
    assert press(operator, "x" * 100_000).status_code == 400
    with site.browser() as stranger:
        assert stranger.post("/emergency", data=data).status_code == 401
    assert actions(station) == []


def test_the_fleets_page_lands_all(operator: httpx.Client, station: Any) -> None:
    assert 'name="action" value="all"' in (Path(STATIC) / "fleet/fleet.html").read_text()
    text = press(operator, "all").text
    assert "quad1: accepted" in text
    assert actions(station) == ["land"]
