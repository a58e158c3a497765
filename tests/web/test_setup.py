"""Routes of the Settings page, and the check list from the station to the page."""

from __future__ import annotations

import math
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest

from console.catalogue.catalogue import Catalogue
from console.link.known_vehicles import KnownVehicles
from vehicle_link.checks import Check, to_messages
from vehicle_link.messages import header, new
from web.access.tls import private_tls
from web.setup.page_checks import page_checks
from web.setup.vehicles import known_vehicles

FOUND = [
    Check("clock", "warn", "not synchronised", "synchronised", "start chrony"),
    Check("log's disk", "ok", "12 GB free", "500 MB free", "delete logs", "vehicle"),
]


@pytest.fixture
def checked(station: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a station that has run its checks."""
    answer = station._call_blocking

    def call(service: str, request: Any) -> Any:
        response = answer(service, request)
        if service == "checks" and response.accepted:
            response.checked, response.checks = 1e9, to_messages(FOUND)
        return response

    monkeypatch.setattr(station, "_call_blocking", call)
    return station


def test_what_station_and_vehicle_found_stands_beside_what_the_page_finds(
    checked: Any, viewer: httpx.Client
) -> None:
    answer = viewer.get("/api/setup/checks").json()
    assert answer["checked"] == 1e9
    assert answer["checks"][0] == {
        "name": "clock",
        "place": "station",
        "state": "warn",
        "found": "not synchronised",
        "wanted": "synchronised",
        "advice": "start chrony",
    }
    assert {one["place"] for one in answer["checks"]} == {"station", "vehicle", "page"}
    service, request = checked.requests[-1]
    assert (service, request.again) == ("checks", False)


def test_an_operator_has_it_looked_at_again_in_his_name(
    checked: Any, operator: httpx.Client
) -> None:
    assert operator.post("/api/setup/checks").status_code == 200
    service, request = checked.requests[-1]
    assert (service, request.again) == ("checks", True)
    assert request.requester.startswith("operator")


def test_a_refusal_to_look_again_comes_with_its_reason(
    station: Any, operator: httpx.Client
) -> None:
    station.refusal = "the vehicle is armed; checks are made on the ground"
    answer = operator.post("/api/setup/checks")
    assert answer.status_code == 409
    assert answer.json()["error"] == station.refusal


def test_without_a_station_the_page_says_so_and_still_tells_of_itself(
    station: Any, viewer: httpx.Client
) -> None:
    station.away = True
    answer = viewer.get("/api/setup/checks").json()
    assert answer["checked"] is None
    first, *others = answer["checks"]
    assert (first["name"], first["state"]) == ("station", "fail")
    assert {one["place"] for one in others} == {"page"}


def test_the_vehicles_of_the_catalogue_are_known_beside_ours(
    station: Any, viewer: httpx.Client
) -> None:
    station.fly()
    ours, *others = viewer.get("/api/setup/vehicles").json()
    assert (ours["name"], ours["ours"], ours["link"]) == ("quad1", True, "good")
    assert ours["last_seen"] == pytest.approx(time.time(), abs=30)
    assert ours["runs"] == 2
    assert all(not one["ours"] for one in others)


def test_an_enrolled_vehicle_is_known_before_it_ever_flew(tmp_path: Path) -> None:
    KnownVehicles(tmp_path).add("quad7", "quad7.local")
    live: Any = SimpleNamespace(age=lambda topic: math.inf, current=lambda topic: None)
    ours, enrolled = known_vehicles({"quad1": live}, Catalogue(tmp_path), 0.0)
    assert (ours["name"], ours["address"]) == ("quad1", "")
    assert (enrolled["name"], enrolled["ours"], enrolled["address"]) == (
        "quad7",
        False,
        "quad7.local",
    )


def test_everybody_sees_who_is_signed_in_and_only_that(site: Any, viewer: httpx.Client) -> None:
    people = viewer.get("/api/setup/people").json()
    mine = viewer.get("/api/session").json()["label"]
    assert mine in {one["name"] for one in people}
    assert {"name", "role", "account", "sessions", "last_seen"} == set(people[0])
    assert all(one["sessions"] > 0 for one in people)


def test_the_pre_flight_list_is_in_the_summary_while_it_is_fresh(
    site: Any, station: Any, viewer: httpx.Client
) -> None:
    stamp = header(time.time_ns())
    battery = Check("battery", "fail", "13.2 V", "at least 14.0 V", "charge it")
    message = new(
        "quadlab_msgs/Preflight", header=stamp, blocks=True, checks=to_messages([battery])
    )
    station.put("preflight", message)
    told = viewer.get("/api/summary").json()["preflight"]
    assert (told["ready"], told["armed"], told["blocks"]) == (False, False, True)
    assert told["checks"] == [
        {
            "name": "battery",
            "state": "fail",
            "found": "13.2 V",
            "wanted": "at least 14.0 V",
            "advice": "charge it",
        }
    ]
    station._live._newest["preflight"].received -= 3.0
    assert viewer.get("/api/summary").json()["preflight"] is None


@pytest.mark.parametrize(
    ("base", "state"),
    [
        ("http://127.0.0.1:8080", "ok"),
        ("http://[::1]:8080", "ok"),
        ("http://192.0.2.7:8080", "fail"),
    ],
)
def test_without_tls_the_page_may_be_for_this_computer_only(base: str, state: str) -> None:
    [tls, *_] = page_checks(base, None, accounts=1)
    assert (tls.name, tls.state) == ("TLS", state)


def test_the_pages_certificate_is_looked_at_with_its_names(tmp_path: Path) -> None:
    tls = private_tls(tmp_path, ("base.lab",))
    found = {one.name: one for one in page_checks("https://base.lab:8080", tls, accounts=0)}
    assert found["TLS"].state == "ok"
    assert found["page's certificate"].state == "ok"
    assert "base.lab" in found["page's certificate"].found
    assert found["accounts"].state == "warn"
    tls.certificate.unlink()
    again = {one.name: one for one in page_checks("https://base.lab:8080", tls, accounts=0)}
    assert again["page's certificate"].state == "fail"
