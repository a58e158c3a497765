"""Several vehicles in one web process: each has separate pages, commands and sticks."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import numpy as np
import pytest
import websockets.exceptions

from benchmarks.page.live_frames import read
from console.catalogue.catalogue import Catalogue
from tests.support.live_signals import ticks_of
from vehicle_link.telemetry import SAMPLES_A_PACKET
from vehicle_link.topics.ticks import TICK_TOPICS
from web.fleet.fleet import SEEN
from web.latest import TICKS

NAMES = ("quad1", "quad2")


@pytest.fixture(scope="module")
def fleet_site(tmp_path_factory: pytest.TempPathFactory, serve: Any) -> Iterator[Any]:
    data = tmp_path_factory.mktemp("fleet")
    with serve(data, Catalogue(data), vehicles=NAMES) as running:
        yield running


@pytest.fixture
def pilot(fleet_site: Any) -> Iterator[httpx.Client]:
    for station in fleet_site.stations:
        station.requests.clear()
        station.refusal, station.said = "", {}
        station.fly()
    with fleet_site.sign_in() as admin, fleet_site.invited(admin, "operator") as client:
        yield client


@pytest.fixture
def viewer(fleet_site: Any, pilot: httpx.Client) -> Iterator[httpx.Client]:
    with fleet_site.invited(pilot, "viewer") as client:
        yield client


WATCHED = SEEN - TICK_TOPICS.keys() | {TICKS}


def asked(station: Any) -> list[str]:
    return [service for service, _ in station.requests]


def routes_of(app: Any) -> set[tuple[str, str]]:
    return {
        (method, route.path)
        for route in app.routes
        for method in getattr(route, "methods", None) or ("SOCKET",)
    }


def test_each_address_is_of_its_vehicle_and_the_root_of_the_first(pilot: httpx.Client) -> None:
    paths = {"/api/session": "quad1", "/v/quad1/api/session": "quad1"}
    paths["/v/quad2/api/session"] = "quad2"
    told = {path: pilot.get(path).json() for path in paths}
    assert {path: one["vehicle"] for path, one in told.items()} == paths
    assert all(one["vehicles"] == list(NAMES) for one in told.values())


def test_every_vehicle_has_the_same_routes(fleet_site: Any) -> None:
    """So the table of test_access applies at every address."""
    first, second = (routes_of(app) for app in fleet_site.gate._app.apps.values())
    assert first == second
    assert ("POST", "/api/commands/arm") in first


def test_an_unknown_vehicle_is_named_with_those_there_are(pilot: httpx.Client) -> None:
    answer = pilot.get("/v/quad9/api/session")
    assert answer.status_code == 404
    line = "there is no vehicle 'quad9' here; there are quad1, quad2"
    assert answer.json() == {"error": line}
    assert pilot.get("/v/quad2").headers["location"] == "/v/quad2/"


@pytest.mark.parametrize("path", ["/v/quad2/", "/v/quad2/api/summary", "/v/quad2/viser/"])
def test_the_gate_stands_before_every_vehicle(fleet_site: Any, path: str) -> None:
    with fleet_site.browser() as nobody:
        assert nobody.get(path).status_code == 401


def test_roles_hold_at_every_vehicle(
    fleet_site: Any, viewer: httpx.Client, pilot: httpx.Client
) -> None:
    for method, path in (("arm", {}), ("disarm", {}), ("emergency", {"action": "cut"})):
        refused = viewer.post(f"/v/quad2/api/commands/{method}", json=path)
        assert refused.status_code == 403
    cookie = fleet_site.cookie(viewer)
    with pytest.raises(websockets.exceptions.InvalidStatus) as closed:
        fleet_site.websocket("/v/quad2/ws/stick", cookie)
    assert closed.value.response.status_code == 403
    with pytest.raises(websockets.exceptions.InvalidStatus) as closed:
        fleet_site.websocket("/v/quad2/ws/events", None)
    assert closed.value.response.status_code == 401
    assert [asked(station) for station in fleet_site.stations] == [[], []]


def test_a_command_reaches_its_vehicle_only(fleet_site: Any, pilot: httpx.Client) -> None:
    assert pilot.post("/v/quad2/api/commands/arm", json={}).status_code == 200
    assert pilot.post("/api/commands/disarm", json={}).status_code == 200
    assert [asked(station) for station in fleet_site.stations] == [["disarm"], ["arm"]]


def test_parameters_are_each_vehicle_s_own(
    fleet_site: Any, pilot: httpx.Client, until: Callable[..., None]
) -> None:
    until(lambda: pilot.get("/v/quad2/api/parameters").json()["parameters"])
    answer = pilot.put("/v/quad2/api/parameters", json={"values": {"gains.kp": 7.0}})
    assert answer.status_code == 200, answer.text
    kept = [station.store.values()["gains.kp"] for station in fleet_site.stations]
    assert kept == [4.0, 7.0]


def test_sticks_go_to_the_vehicle_whose_page_is_open(fleet_site: Any, pilot: httpx.Client) -> None:
    first, second = fleet_site.stations
    with fleet_site.websocket("/v/quad2/ws/stick", fleet_site.cookie(pilot)) as socket:
        for number, held in enumerate((0.0, 1.0)):
            socket.send(struct.pack("<5f2I", 0.0, 0.0, 0.0, 0.0, held, number, 0))
            socket.recv(10)
    assert first.sticks == []
    assert ((0.0, 0.0, 0.0, 0.0), True) in second.sticks


def test_control_of_one_is_not_control_of_the_other(fleet_site: Any, pilot: httpx.Client) -> None:
    fleet_site.stations[1].control("ada")
    holders = {one["name"]: one["holder"] for one in pilot.get("/api/fleet").json()}
    assert holders["quad2"] == "ada"
    assert holders["quad1"] != "ada"
    pilot.post("/v/quad2/api/control", json={"action": "ask"})
    assert [asked(station) for station in fleet_site.stations] == [[], ["control"]]


def test_events_are_of_one_vehicle_and_news_of_runs_are_everybody_s(
    fleet_site: Any, pilot: httpx.Client
) -> None:
    cookie = fleet_site.cookie(pilot)
    first, second = (station._hub for station in fleet_site.stations)
    with fleet_site.websocket("/v/quad2/ws/events", cookie) as socket:
        assert json.loads(socket.recv(10))["vehicle"] == "quad2"
        first.publish_from_thread(
            {"type": "event", "level": "info", "text": "of quad1", "source": "x", "stamp": 0.0}
        )
        first.publish_from_thread({"type": "runs", "runs": ["a run"]})
        messages: list[dict[str, Any]] = []
        while not messages or messages[-1]["type"] != "runs":
            messages.append(json.loads(socket.recv(10)))
    assert "of quad1" not in str(messages)
    assert "of quad1" not in str(second.lines)


def test_the_fleet_s_socket_tells_how_and_where_each_one_is(
    fleet_site: Any, pilot: httpx.Client
) -> None:
    first, second = fleet_site.stations
    second.said = {"armed": False, "airborne": False}
    second.fly(x=-1.0, y=0.5, z=0.0)
    told: dict[str, Any] = {}
    expected = [[1.0, 2.0, 1.5], [-1.0, 0.5, 0]], (True, 1.5, 15.6, "good")
    with fleet_site.websocket("/ws/fleet?plot=1", fleet_site.cookie(pilot)) as socket:
        for _ in range(50):  # what was sent is dropped soon after, so send it again
            first.fly(x=1.0, y=2.0, z=1.5)
            second.fly(x=-1.0, y=0.5, z=0.0)
            told |= json.loads(socket.recv(10))  # vehicles are sent at first and when they change
            positions = [where and where[:3] for where in told["positions"]]
            one, two = told["vehicles"]
            how = one["armed"], one["height"], one["battery"], one["link"]["state"]
            if (positions, how) == expected:
                break
        else:
            pytest.fail(f"the socket told {positions}, {how}")
    assert (two["name"], two["armed"]) == ("quad2", False)


def test_land_all_tells_what_each_vehicle_made_of_it(fleet_site: Any, viewer: httpx.Client) -> None:
    first, second = fleet_site.stations
    second.refusal = "already landing"
    answer = viewer.post("/v/quad2/api/fleet/land", json={}).json()["vehicles"]
    assert answer == [
        {"name": "quad1", "outcome": "accepted", "reason": ""},
        {"name": "quad2", "outcome": "failed", "reason": "already landing"},
    ]
    assert [request.action for _, request in first.requests] == ["land"]


def test_land_all_leaves_alone_what_stands_with_its_motors_off(
    fleet_site: Any, viewer: httpx.Client
) -> None:
    second = fleet_site.stations[1]
    second.said = {"armed": False, "airborne": False}
    second.fly()
    answer = viewer.post("/api/fleet/land", json={}).json()["vehicles"]
    assert [one["outcome"] for one in answer] == ["accepted", "motors off"]
    assert second.requests == []


def test_each_page_shows_the_ticks_of_its_own_vehicle(fleet_site: Any, pilot: httpx.Client) -> None:
    name, (first, second) = "state.position.x", fleet_site.stations
    asked = json.dumps({"id": 7, "signals": [], "series": [{"signals": [name]}]})
    for address, x in (("", 1.5), ("/v/quad2", -2.5)):
        with fleet_site.websocket(f"{address}/ws/telemetry", fleet_site.cookie(pilot)) as page:
            page.send(asked)
            found: list[float] = []
            while len(found) < 3:
                first.fly(x=1.5)
                second.fly(x=-2.5)
                raw = page.recv(timeout=10.0)
                parts = read(raw, [], [[name]]).series if raw[:2] == b"\7\0" else {}
                values = [one for part in parts.values() for one in part.values[name].tolist()]
                found += [one for one in values if math.isfinite(one)]  # a hole has none
            assert found[-1] == x


def test_a_page_that_switches_gets_what_the_other_vehicle_flew_by_that_ones_clock(
    fleet_site: Any, pilot: httpx.Client
) -> None:
    name, flown = "state.position.x", {"": (30, 1.5, 0.0), "/v/quad2": (20, -2.5, 3600.0)}
    for station, (count, x, start) in zip(fleet_site.stations, flown.values(), strict=True):
        ticks = ticks_of(count, start=start)  # before the page, and long before all other ticks
        ticks["state"]["position_w"][:, 0] = x
        for k in range(0, count, SAMPLES_A_PACKET):
            station.put(TICKS, ticks[k : k + SAMPLES_A_PACKET])
    asked = json.dumps({"id": 7, "signals": [], "series": [{"signals": [name]}]})
    for address in ("", "/v/quad2", ""):
        count, x, start = flown[address]
        with fleet_site.websocket(f"{address}/ws/telemetry", fleet_site.cookie(pilot)) as page:
            page.send(asked)
            while (raw := page.recv(timeout=10.0))[:2] != b"\7\0":
                pass
        frame = read(raw, [], [[name]])
        stamps = np.rint(1e9 * frame.series[0].time).astype(int) + 10**9 * int(frame.origin)
        assert stamps.tolist() == ticks_of(count, start=start)["imu"]["stamp_ns"].tolist()
        assert frame.series[0].values[name].tolist() == [x] * count


def test_what_comes_fast_is_taken_of_the_vehicle_that_is_looked_at(
    fleet_site: Any, pilot: httpx.Client, until: Callable[..., None], monkeypatch: Any
) -> None:
    monkeypatch.setattr("web.fleet.fleet.LINGER", 0.0)
    monkeypatch.setattr("web.live.telemetry.KEPT", 0.0)
    first, second = fleet_site.stations
    with fleet_site.websocket("/v/quad2/ws/events", fleet_site.cookie(pilot)):
        until(lambda: second.watched == WATCHED and not first.watched)
    with fleet_site.websocket("/ws/fleet?plot=1", fleet_site.cookie(pilot)):
        until(lambda: first.watched == second.watched == {TICKS})
    until(lambda: not first.watched and not second.watched)


def test_the_set_up_page_lists_every_vehicle_the_station_dials(pilot: httpx.Client) -> None:
    found = pilot.get("/v/quad2/api/setup/vehicles").json()
    assert [(one["name"], one["ours"], one["link"]) for one in found] == [
        ("quad1", True, "good"),
        ("quad2", True, "good"),
    ]
