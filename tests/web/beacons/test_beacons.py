"""Layouts and the shared view: routes, refusals, roles."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Any

import httpx
import pytest

from bearing_sim.beacons import PAPER_BEACONS, PRESETS, parse_layout
from quadrotor.errors import RefusedError
from tests.support.clock import Clock
from vehicle_link.parameters.messages import from_parameters
from web.beacons.moves import BeaconMoves
from web.beacons.routes import csv_of, layout_of, rows_of
from web.live.events import EventHub
from web.parameters.replica import LAYOUT

SQUARE = [[1, 1.5, 1.0, 0.1], [2, -1.0, 1.0, 0.1], [3, -1.0, -1.0, 0.1], [4, 1.0, -1.0, 0.1]]
CSV = "id,x,y,z\n7,1.0,1.0,0.1\n2,-1.0,1.0,0.1\n3,-1.0,-1.0,0.1\n4,1.0,-1.0,0.1\n"


@pytest.fixture
def site(beacon_site: Any, until: Callable[..., None]) -> Any:
    """Return the site once its parameters are read and the paper's beacons confirmed."""
    beacon_site.station.fly()
    with beacon_site.sign_in() as client:

        def read() -> bool:
            beacon_site.station.fly()
            return bool(client.get("/api/beacons").json()["layout"])

        until(read)
        client.put("/api/beacons", json={"preset": "paper"})
    return beacon_site


def changes(station: Any) -> list[tuple[str, str]]:
    """Return (layout, requester) of every change of it that reached the station."""
    return [
        (str(from_parameters(request.parameters)[LAYOUT]), request.requester)
        for service, request in station.requests
        if service == "change_parameters"
    ]


# ---------------------------------------------------------------------- layouts
def test_the_layout_is_what_the_station_confirmed(operator: httpx.Client) -> None:
    got = operator.get("/api/beacons").json()
    assert got["layout"] == "paper"
    assert got["beacons"] == rows_of(PAPER_BEACONS)
    assert got["presets"] == {name: rows_of(preset) for name, preset in PRESETS.items()}
    assert got["gains"]["paper"]["estimation.attitude_bandwidth"] == 62.8


def test_rows_become_the_layout_in_the_name_of_who_asked(
    operator: httpx.Client, station: Any
) -> None:
    label = operator.get("/api/session").json()["label"]
    answer = operator.put("/api/beacons", json=SQUARE)
    assert answer.status_code == 200
    assert answer.json()["beacons"] == SQUARE
    assert changes(station) == [(answer.json()["layout"], label)]
    assert rows_of(parse_layout(station.store.values()[LAYOUT])) == SQUARE
    assert operator.get("/api/beacons").json()["beacons"] == SQUARE


def test_a_preset_becomes_the_layout(operator: httpx.Client, station: Any) -> None:
    assert operator.put("/api/beacons", json={"preset": "ceiling"}).json()["layout"] == "ceiling"
    assert station.store.values()[LAYOUT] == "ceiling"


def test_a_file_becomes_the_layout_and_comes_back_to_the_last_digit(
    operator: httpx.Client, station: Any
) -> None:
    third = CSV.replace("7,1.0", f"7,{1 / 3!r}")
    answer = operator.put(
        "/api/beacons", content=third.encode(), headers={"content-type": "text/csv; charset=utf-8"}
    )
    assert answer.status_code == 200, answer.text
    assert answer.json()["beacons"][0] == [7, 1 / 3, 1.0, 0.1]
    saved = operator.get("/api/beacons/file")
    assert saved.text == third
    assert saved.headers["content-type"].startswith("text/csv")
    assert "beacons.csv" in saved.headers["content-disposition"]


@pytest.mark.parametrize("preset", PRESETS)
def test_every_set_survives_its_file(preset: str) -> None:
    assert (
        parse_layout(layout_of(csv_of(PRESETS[preset]).encode(), "text/csv", "f"))
        == (PRESETS[preset])
    )


IN_LINE = [[k, float(k), 0.0, 0.1] for k in range(1, 5)]
BAD_ROWS = [
    (SQUARE[:3], "3 beacons; allowed are 4 to 32: add 1"),
    (IN_LINE, "on one line"),
    ([*SQUARE[:3], [1, 1.0, -1.0, 0.1]], "beacon id 1 appears more than once"),
    ([*SQUARE[:3], [4, 1e9, -1.0, 0.1]], "allowed are finite numbers within ±1000 m"),
    ([*SQUARE[:3], [4, "one", -1.0, 0.1]], r"Expected `float`, got `str` - at `$[3][1]`"),
    ([*SQUARE[:3], [4, 1.0, -1.0]], "Expected `array` of length 4"),
    ({"preset": "circle"}, "no preset is called 'circle'; there are paper, wide"),
    ({"name": "paper"}, "allowed is [[id, x, y, z], …]"),
    ("paper", "allowed is [[id, x, y, z], …]"),
]


@pytest.mark.parametrize(("body", "reason"), BAD_ROWS)
def test_a_layout_that_is_none_is_refused_and_nothing_changes(
    operator: httpx.Client, station: Any, body: Any, reason: str
) -> None:
    answer = operator.put("/api/beacons", json=body)
    assert answer.status_code == 422
    assert reason in answer.json()["error"]
    assert "\n" not in answer.json()["error"]
    assert changes(station) == []
    assert operator.get("/api/beacons").json()["layout"] == "paper"


BAD_FILES = [
    (CSV.replace("-1.0,1.0,0.1", "-1.0,abc,0.1"), "line 3, column 8: y is 'abc'"),
    (CSV.replace("id,x,y,z", "name,x,y,z"), "line 1, column 1"),
    (CSV.replace("4,1.0", "7,1.0"), "line 5, column 1: id 7 is already on line 2"),
    ("", "line 1, column 1: the file is empty"),
    ("id,x,y,z\n1,1,1,0\n2,1,2,0\n", "2 beacons; allowed are 4 to 32"),
    ("id,x,y,z\n" + "# a long comment\n" * 10_000, "more than 100000 bytes"),
]


@pytest.mark.parametrize(("text", "reason"), BAD_FILES)
def test_a_file_that_is_none_is_refused_where_it_is_wrong(
    operator: httpx.Client, station: Any, text: str, reason: str
) -> None:
    answer = operator.put(
        "/api/beacons",
        params={"name": "lab.csv"},
        content=text.encode(),
        headers={"content-type": "text/csv"},
    )
    assert answer.status_code == 422
    assert "beacons lab.csv" in answer.json()["error"]
    assert reason in answer.json()["error"]
    assert changes(station) == []


def test_the_vehicles_refusal_reaches_the_page(operator: httpx.Client, station: Any) -> None:
    station.refusal = f"{LAYOUT} not changed, refused by the vehicle: on bearings"
    answer = operator.put("/api/beacons", json=SQUARE)
    assert answer.status_code == 409
    assert answer.json()["error"] == station.refusal
    assert operator.get("/api/beacons").json()["layout"] == "paper"


def test_viewers_see_and_change_nothing(viewer: httpx.Client, station: Any) -> None:
    assert viewer.get("/api/beacons").json()["layout"] == "paper"
    assert viewer.get("/api/beacons/file").status_code == 200
    for path, body in (("/api/beacons", SQUARE), ("/api/beacons/view", {"rays": False})):
        answer = viewer.put(path, json=body)
        assert answer.status_code == 403
        assert "may watch but not command" in answer.json()["error"]
    assert changes(station) == []


def test_the_routes_are_described(operator: httpx.Client) -> None:
    paths = operator.get("/api/openapi.json").json()["paths"]
    put = paths["/api/beacons"]["put"]
    assert set(put["requestBody"]["content"]) == {"application/json", "text/csv"}
    assert "line and column" in put["description"]
    assert paths["/api/beacons/view"]["put"]["description"]


# ---------------------------------------------------------------------- the view
def test_the_view_is_shared_and_every_page_is_told(site: Any, operator: httpx.Client) -> None:
    before = operator.get("/api/beacons").json()["view"]
    with site.websocket("/ws/events", site.cookie(operator)) as page:
        answer = operator.put("/api/beacons/view", json={"rays": not before["rays"]})
        assert answer.json()["view"] == {**before, "rays": not before["rays"]}
        while (message := json.loads(page.recv(timeout=10.0)))["type"] != "beacon_view":
            pass
    assert {"view": message["view"], "legend": message["legend"]} == answer.json()
    assert operator.get("/api/beacons").json()["view"] == answer.json()["view"]
    answer = operator.put("/api/beacons/view", json={"rays": before["rays"]})
    assert answer.status_code == 200, answer.text
    assert answer.json()["view"] == before


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ({"map_height": 99.0}, "map_height: Input should be less than or equal to 20"),
        ({"estimate": "kalman"}, "no estimate is called 'kalman'; there are none, one frame"),
        ({"color": "red"}, "Extra inputs are not permitted"),
    ],
)
def test_a_view_that_cannot_be_shown_is_refused(
    operator: httpx.Client, body: dict[str, Any], reason: str
) -> None:
    before = operator.get("/api/beacons").json()["view"]
    answer = operator.put("/api/beacons/view", json=body)
    assert answer.status_code == 422
    assert reason in answer.json()["error"]
    assert operator.get("/api/beacons").json()["view"] == before


# ---------------------------------------------------------------------- drags
class Gains:
    """Gain path that can be delayed and can refuse."""

    def __init__(self, replica: Replica) -> None:
        self.replica = replica
        self.calls: list[tuple[str, str]] = []
        self.refusal = ""
        self.gate = asyncio.Event()

    async def change(self, values: dict[str, str], requester: str) -> None:
        self.calls.append((values[LAYOUT], requester))
        await self.gate.wait()
        if self.refusal:
            raise RefusedError(self.refusal)
        self.replica.text = values[LAYOUT]


class Replica:
    text = "paper"

    def value(self, name: str) -> str:
        assert name == LAYOUT
        return self.text


async def dragged(steps: list[tuple[int, tuple[float, float, float]]], refusal: str) -> Any:
    """Return the replica, gain path, number of resets of the handles, and event lines.

    They are those after these steps.
    """
    replica, hub = Replica(), EventHub()
    gains, back = Gains(replica), []
    gains.refusal = refusal
    moves = BeaconMoves(
        gains,  # type: ignore[arg-type]
        replica,  # type: ignore[arg-type]
        hub,
        lambda: back.append(1),
        Clock(10.0),
    )
    for id, place in steps:
        moves.moved(id, place, "operator 1")
    await asyncio.sleep(0)
    gains.gate.set()
    while moves.busy:
        await asyncio.sleep(0)
    return replica, gains, len(back), hub.lines


def test_two_beacons_dragged_at_once_do_not_undo_each_other() -> None:
    steps = [(1, (1.2, 1.0, 0.1)), (3, (-1.4, -1.0, 0.1)), (1, (1.300004, 1.0, 0.1))]
    replica, gains, back, lines = asyncio.run(dragged(steps, ""))
    layout = parse_layout(replica.text)
    assert layout.place(1) == (1.3, 1.0, 0.1), "to a tenth of a millimetre"
    assert layout.place(3) == (-1.4, -1.0, 0.1)
    assert {who for _, who in gains.calls} == {"operator 1"}
    assert (back, lines) == (0, [])


@pytest.mark.parametrize(
    ("place", "refusal", "reason"),
    [
        ((1.2, 1.0, 0.1), "the vehicle flies on bearings", "the vehicle flies on bearings"),
        ((1e6, 1.0, 0.1), "", "within ±1000 m"),
    ],
)
def test_a_refused_drag_goes_back_and_says_why_once_a_second(
    place: tuple[float, float, float], refusal: str, reason: str
) -> None:
    replica, _, back, lines = asyncio.run(dragged([(1, place), (1, place)], refusal))
    assert replica.text == "paper"
    assert back == 2
    assert len(lines) == 1
    assert lines[0]["level"] == "warn"
    assert "beacon 1 not moved (operator 1)" in lines[0]["text"]
    assert reason in lines[0]["text"]
