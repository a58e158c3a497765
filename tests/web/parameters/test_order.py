"""The replica ends on the newest value whatever the order of arrival; long ways need steps."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Mapping
from typing import Any

import pytest

from quadrotor.errors import LinkError, QuadlabError, RefusedError
from quadrotor.parameter_description import ParameterValue
from tests.support.parameters import described
from vehicle_link.parameters.change import ParameterChange
from web.parameters.replica import PageParameters
from web.parameters.writer import ParameterWriter

KP, KV, RATES, STATION = "control.kp", "control.kv", "control.rates", "station.delay"


def replica_of(told: list[Any] | None = None) -> PageParameters:
    replica = PageParameters((told if told is not None else []).append)
    free = {"minimum": None, "maximum": None, "step": None}
    descriptions = [
        described(KP, flight_step=4.0),
        described(KV, flight_step=2.0),
        described(RATES, "str", default="nominal", choices=("nominal", "exact"), **free),
        described(STATION),
    ]
    replica.load({KP: 4.0, KV: 3.0, RATES: "nominal", STATION: 0.0}, 0, descriptions=descriptions)
    return replica


@pytest.mark.parametrize("order", list(itertools.permutations(range(1, 5))))
def test_the_newest_revision_wins_whatever_comes_first(order: tuple[int, ...]) -> None:
    told: list[Any] = []
    replica = replica_of(told)
    for revision in order:
        replica.confirm({KP: float(revision)}, "x", revision)
    assert replica.value(KP) == 4.0
    shown = [m["revision"] for m in told if m["type"] == "parameter"]
    assert shown == sorted(shown)


def test_revisions_of_one_parameter_do_not_hold_up_another() -> None:
    replica = replica_of()
    replica.confirm({KP: 7.0}, "x", 9)
    replica.confirm({KV: 2.0}, "x", 8)
    assert replica.value(KV) == 2.0


def test_what_comes_while_all_is_read_is_newer_than_what_was_read() -> None:
    replica = replica_of()
    since = replica.clock
    replica.confirm({KP: 9.0}, "x", 5)
    replica.load({KP: 8.0, KV: 1.0}, 4, since=since, descriptions=replica.descriptions())
    assert (replica.value(KP), replica.value(KV)) == (9.0, 1.0)
    replica.confirm({KP: 8.5}, "x", 4)
    assert replica.value(KP) == 9.0


def test_a_restart_begins_a_generation_in_which_lower_revisions_count() -> None:
    replica = replica_of()
    replica.confirm({KP: 9.0}, "x", 50)
    before = replica.generation
    replica.load({KP: 4.0}, 0, instance=2, descriptions=replica.descriptions())
    assert replica.generation > before
    replica.confirm({KP: 5.0}, "x", 1)
    assert replica.value(KP) == 5.0


def test_a_station_that_restarts_unseen_is_known_by_its_own_news() -> None:
    replica = replica_of()
    replica.note_change(ParameterChange(0, STATION, 0.0, 0.5, "x", 30, 1))
    replica.note_change(ParameterChange(0, STATION, 0.0, 0.6, "x", 29, 1))
    assert replica.value(STATION) == 0.5, "late, of the same process"
    replica.note_change(ParameterChange(0, STATION, 0.0, 0.7, "x", 1, 2))
    assert replica.value(STATION) == 0.7
    replica.note_change(ParameterChange(0, KP, 4.0, 6.0, "x", 1, 3))
    assert replica.value(KP) == 6.0


class Vehicle:
    """Vehicle that applies at once changes within the step limits, and refuses others."""

    def __init__(self, replica: PageParameters) -> None:
        self.values = replica.values()
        self.steps = {d.name: d.flight_step for d in replica.descriptions()}
        self.calls: list[dict[str, ParameterValue]] = []
        self.errors: dict[int, QuadlabError] = {}

    async def change_parameters(
        self, values: Mapping[str, ParameterValue], requester: str
    ) -> tuple[dict[str, ParameterValue], int]:
        self.calls.append(dict(values))
        if (error := self.errors.get(len(self.calls))) is not None:
            raise error
        for name, value in values.items():
            step = self.steps[name]
            if step is not None and abs(float(value) - float(self.values[name])) > step * 1.000001:
                raise RefusedError(f"{name} = {value} is too far")
        self.values.update(values)
        return dict(values), len(self.calls)


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("web.parameters.writer.SHORTEST_PERIOD", 0.001)


def flying() -> tuple[ParameterWriter, Vehicle, PageParameters]:
    replica = replica_of()
    vehicle = Vehicle(replica)
    return ParameterWriter(replica, vehicle, airborne=lambda: True), vehicle, replica


def test_a_slider_walks_where_one_step_is_too_large() -> None:
    path, vehicle, replica = flying()
    asyncio.run(path.change({KP: 15.0}, "x", walks=True))
    assert [c[KP] for c in vehicle.calls] == [8.0, 12.0, 15.0]
    assert replica.value(KP) == 15.0


def test_what_is_typed_does_not_walk() -> None:
    path, vehicle, replica = flying()
    with pytest.raises(RefusedError, match="too far"):
        asyncio.run(path.change({KP: 15.0}, "x"))
    assert (len(vehicle.calls), replica.value(KP)) == (1, 4.0)


def test_a_newer_wish_turns_a_walk_round() -> None:
    async def scenario() -> None:
        path, vehicle, replica = flying()
        far = asyncio.create_task(path.change({KP: 20.0}, "x", walks=True))
        while not vehicle.calls:
            await asyncio.sleep(0)
        await path.change({KP: 4.0}, "x", walks=True)
        await far
        assert replica.value(KP) == vehicle.values[KP] == 4.0

    asyncio.run(scenario())


def test_two_hands_that_walk_against_each_other_come_to_an_end() -> None:
    async def scenario() -> None:
        path, vehicle, replica = flying()
        both = (
            path.change({KP: 20.0}, "anna", walks=True),
            path.change({KP: 0.0}, "ben", walks=True),
        )
        await asyncio.wait_for(asyncio.gather(*both, return_exceptions=True), 10.0)
        assert len(vehicle.calls) <= 6
        assert replica.value(KP) == vehicle.values[KP]

    asyncio.run(scenario())


def test_one_hands_refusal_is_not_the_others() -> None:
    async def scenario() -> None:
        path, vehicle, _ = flying()
        vehicle.errors = {1: RefusedError("ben has no control")}
        ben, anna = path.change({KP: 5.0}, "ben"), path.change({KP: 6.0}, "anna")
        refused, applied = await asyncio.gather(ben, anna, return_exceptions=True)
        assert isinstance(refused, RefusedError)
        assert applied == ({KP: 6.0}, 2)

    asyncio.run(scenario())


def test_a_set_walks_on_the_straight_line_and_what_has_no_step_goes_first() -> None:
    path, vehicle, replica = flying()
    wanted = {KP: 14.0, KV: 4.5, RATES: "exact"}
    applied, _ = asyncio.run(path.change(wanted, "x", walks=True))
    assert vehicle.calls[0][RATES] == "exact"
    assert [c[KP] for c in vehicle.calls] == pytest.approx([4 + 10 / 3, 4 + 20 / 3, 14.0])
    assert [c[KV] for c in vehicle.calls] == pytest.approx([3.5, 4.0, 4.5])
    assert applied == wanted
    assert replica.values() == {**wanted, STATION: 0.0}


def test_a_set_within_the_steps_is_one_change() -> None:
    path, vehicle, _ = flying()
    asyncio.run(path.change({KP: 8.0, KV: 5.0, RATES: "exact"}, "x", walks=True))
    assert vehicle.calls == [{KP: 8.0, KV: 5.0, RATES: "exact"}]


def test_a_walk_refused_on_the_way_goes_back() -> None:
    path, vehicle, replica = flying()
    before = replica.values()
    vehicle.errors = {3: RefusedError("someone else has control now")}
    with pytest.raises(RefusedError, match="control now; all values are as before"):
        asyncio.run(path.change({KP: 16.0, RATES: "exact"}, "x", walks=True))
    assert vehicle.values == before
    assert replica.values() == before


def test_a_walk_that_cannot_go_back_says_where_it_is() -> None:
    path, vehicle, replica = flying()
    vehicle.errors = {k: LinkError("no answer") for k in range(3, 20)}
    with pytest.raises(LinkError, match="2 steps were made and could not be taken back"):
        asyncio.run(path.change({KP: 16.0, RATES: "exact"}, "x", walks=True))
    assert replica.value(KP) == vehicle.values[KP] == 12.0
