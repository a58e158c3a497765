"""The routes of the formation: a person's sticks become those of all vehicles, or are dropped."""

from __future__ import annotations

import json
import struct
import time
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest
import websockets.exceptions

from extensions.formations.live.squad import Squad
from extensions.formations.tests.conftest import PLACES
from vehicle_link.clock import time_ns
from vehicle_link.messages import decode, stamp_of
from vehicle_link.topics.table import TOPICS
from web.commands.sticks import StickOutput


@pytest.fixture
def operator(fleet: Any) -> Iterator[httpx.Client]:
    for station in fleet.stations:
        station.said, station.answers_sticks = {"behavior": "velocity"}, True
        station.control("")
        station.sticks.clear()
    with fleet.sign_in() as admin, fleet.invited(admin, "operator") as client:
        yield client


class Hand:
    """The dead-man button of a page."""

    def __init__(self, socket: Any) -> None:
        self._socket, self._number = socket, 0

    def send(self, axes: tuple[float, ...] = (0.0,) * 5, held: bool = True) -> dict[str, Any]:
        """Send a frame; return its answer."""
        self._number += 1
        frame = struct.pack("<5f2I", *axes[:4], float(held), self._number, 0)
        self._socket.send(frame + struct.pack("<f", axes[4]))
        while (answer := json.loads(self._socket.recv(10)))["n"] != self._number:
            pass
        return dict(answer)

    def hold(
        self, done: Callable[[dict[str, Any]], bool], until: Callable[..., None]
    ) -> dict[str, Any]:
        """Hold the button until something is so, judged with each answer; return the last one."""
        answers: list[dict[str, Any]] = []

        def held() -> bool:
            answers.append(self.send())
            return done(answers[-1])

        until(held)
        return answers[-1]


@pytest.fixture
def hand(fleet: Any, operator: httpx.Client) -> Iterator[Hand]:
    with fleet.websocket("/formation/sticks", fleet.cookie(operator)) as socket:
        yield Hand(socket)


def _pressed(hand: Hand, until: Callable[..., None]) -> None:
    """Press the button as soon as the vehicles are known to fly velocity."""

    def counts() -> bool:
        hand.send(held=False)
        return bool(hand.send()["on"])

    until(counts)


def _all_sent(fleet: Any) -> bool:
    return all(any(enabled for _, enabled in one.sticks) for one in fleet.stations)


def test_a_held_button_sends_each_vehicle_its_own_sticks_after_a_release(
    fleet: Any, hand: Hand, until: Callable[..., None]
) -> None:
    _pressed(hand, until)

    def all_measured(_: object) -> bool:
        return _all_sent(fleet) and all(one.published for one in fleet.stations)

    assert hand.hold(all_measured, until)["on"]
    for k, station in enumerate(fleet.stations):
        assert station.sticks[0] == ((0.0, 0.0, 0.0, 0.0), False)
        # What its sensor has measured is recorded.
        topic, payload, stamp_ns = station.published[-1]
        seen = decode(payload, TOPICS[topic].type_name)
        assert topic == "neighbour_bearings"
        assert stamp_of(seen) == stamp_ns
        assert 0 < abs(time_ns() - stamp_ns) < 60 * 10**9
        assert set(seen.beacon_ids.tolist()) <= {1, 2, 3} - {k + 1}
    hand.send(held=False)
    last = [station.sticks[-1] for station in fleet.stations]
    assert last == [((0.0, 0.0, 0.0, 0.0), False)] * 3


def test_one_station_that_drops_the_sticks_stops_all_and_is_named(
    fleet: Any, hand: Hand, until: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second, third = fleet.stations

    def refuse(axes: tuple[float, ...], enabled: bool, requester: str) -> int:
        stamp_ns = time.time_ns()
        second.reactions.stick_answered(stamp_ns, False, "dropped by the station's watchdog")
        return stamp_ns

    monkeypatch.setattr(second, "publish_stick", refuse)
    _pressed(hand, until)
    answer: dict[str, Any] = {"on": True}

    def dropped() -> bool:
        answer.update(hand.send())
        return not answer["on"]

    until(dropped)
    assert answer["why"] == "quad2: dropped by the station's watchdog"
    for station in (first, third):
        assert station.sticks[-1] == ((0.0, 0.0, 0.0, 0.0), False)


def test_sticks_of_one_vehicle_that_another_page_has_are_sent_to_no_further_vehicle(
    fleet: Any, hand: Hand, until: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[StickOutput] = []

    def taken(self: StickOutput, *_: Any) -> bool:
        asked.append(self)
        return False

    monkeypatch.setattr(StickOutput, "send", taken)
    _pressed(hand, until)
    answer: dict[str, Any] = {"on": True}

    def dropped() -> bool:
        answer.update(hand.send())
        return not answer["on"]

    until(dropped)
    assert answer["why"] == "another page has the sticks of quad1"
    assert len(asked) == 1


def test_programs_that_end_with_an_error_stop_all_and_begin_again_with_the_next_page(
    fleet: Any,
    operator: httpx.Client,
    hand: Hand,
    until: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _pressed(hand, until)
    hand.hold(lambda _: _all_sent(fleet), until)
    with monkeypatch.context() as broken:
        broken.setattr(Squad, "step", lambda *_: 1 / 0)
        answer = hand.hold(lambda answered: not answered["on"], until)
        assert "its programs ended with an error (division by zero)" in answer["why"]
        for station in fleet.stations:
            until(lambda s=station: not s.sticks[-1][1])
            station.sticks.clear()
    with fleet.websocket("/formation/sticks", fleet.cookie(operator)) as socket:
        again = Hand(socket)
        _pressed(again, until)
        assert again.hold(lambda _: _all_sent(fleet), until)["on"]


def test_a_page_that_is_gone_stops_all(
    fleet: Any, operator: httpx.Client, until: Callable[..., None]
) -> None:
    with fleet.websocket("/formation/sticks", fleet.cookie(operator)) as socket:
        hand = Hand(socket)
        _pressed(hand, until)
        hand.hold(lambda _: _all_sent(fleet), until)
    stopped = ((0.0, 0.0, 0.0, 0.0), False)
    until(lambda: all(station.sticks[-1] == stopped for station in fleet.stations))


def test_too_few_vehicles_and_another_s_control_are_told(
    fleet: Any, hand: Hand, until: Callable[..., None]
) -> None:
    why: list[str] = []

    def refused(line: str) -> Callable[[], bool]:
        def is_so() -> bool:
            hand.send(held=False)
            why.append(hand.send()["why"])
            return why[-1] == line

        return is_so

    fleet.stations[2].said = {"behavior": "hover"}
    until(refused("2 of at least 3 vehicles fly velocity"))
    for station in fleet.stations:
        station.sticks.clear()  # until it was known to hover, they were sent
    fleet.stations[1].control("ada")
    fleet.stations[2].said = {"behavior": "velocity"}
    until(refused("ada has control of quad2"))
    assert not any(enabled for one in fleet.stations for _, enabled in one.sticks)


def test_the_formation_is_shown_to_viewers_who_may_not_steer_it(
    fleet: Any, operator: httpx.Client
) -> None:
    with fleet.invited(operator, "viewer") as viewer:
        cookie = fleet.cookie(viewer)
        with fleet.websocket("/formation", cookie) as socket:
            for _ in range(100):
                now = json.loads(socket.recv(10))
                if (
                    now["flying"] == [0, 1, 2]
                    and len(now["edges"]) == 6
                    and now["eigenvalue"] > 1.0
                ):
                    break
            else:
                pytest.fail(f"the socket told {now}")
        assert [pose[:3] for pose in now["poses"]] == [list(one) for one in PLACES]
        assert now["bound"] == 0.02
        with pytest.raises(websockets.exceptions.InvalidStatus):
            fleet.websocket("/formation/sticks", cookie)
        assert viewer.put("/api/formation", json={"speed": 0.1}).status_code == 403


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"desired": "1 2 0 0"}, "experiment.desired: the formation is not rigid; it lacks quad"),
        ({"desired": "1 9 0 0"}, "is about vehicle 9; there are 1 to 3"),
        ({"speed": 3.0}, "speed"),
    ],
)
def test_a_shape_or_speed_that_cannot_be_flown_changes_nothing(
    operator: httpx.Client, change: dict[str, Any], line: str
) -> None:
    before = operator.get("/v/quad2/api/formation").json()
    answer = operator.put("/api/formation", json=change)
    assert answer.status_code in (400, 422)
    assert line in answer.json()["error"]
    assert operator.get("/api/formation").json() == before
    changed = operator.put("/v/quad3/api/formation", json={"speed": 0.25}).json()
    assert changed["speed"] == 0.25
    assert operator.get("/api/formation").json() == changed
    operator.put("/api/formation", json={"speed": before["speed"]})
