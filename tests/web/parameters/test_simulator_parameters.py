"""Parameters of the simulated world: listed while it runs, changed apart from the vehicle's."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any

import pytest

from quadrotor.errors import LinkError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from vehicle.simulator.live_parameters import SimulatorTree
from web.parameters.follower import ParameterFollower
from web.parameters.replica import PageParameters
from web.parameters.writer import ParameterWriter

GUST, DRAG, LAYOUT = "simulator.gust", "simulator.drag", "station.bearings.layout"
WORLD = ParameterStore(SimulatorTree())


class Nodes:
    """Fake of web.live.station.Station, in which only some nodes answer."""

    def __init__(self) -> None:
        self.is_there = True

    async def has_parameters(self, remote: str) -> bool:
        assert remote == "/quad1/simulator"
        return self.is_there


def test_a_simulator_that_comes_is_news_at_once_and_one_that_goes_at_the_second_look() -> None:
    nodes, nothing = Nodes(), None
    replica = PageParameters(lambda _: None)
    follower = ParameterFollower(replica, nodes, nothing, nothing, "/quad1")  # type: ignore[arg-type]

    def looks(*there: bool) -> list[bool]:
        news = []
        for nodes.is_there in there:
            news.append(asyncio.run(follower.is_simulator_news()))
        return news

    assert looks(False, True) == [False, True]
    replica.load(WORLD.values(), 0, descriptions=WORLD.descriptions())
    assert looks(True, False, True, False, False) == [False, False, False, False, True]


class Vehicle:
    """Vehicle that applies everything except what it refuses."""

    def __init__(self, refused: str = "") -> None:
        self.calls: list[set[str]] = []
        self.refused = refused

    async def change_parameters(
        self, values: Mapping[str, ParameterValue], requester: str
    ) -> tuple[dict[str, ParameterValue], int]:
        self.calls.append(set(values))
        if self.refused in values:
            raise LinkError("it did not answer")
        return dict(values), len(self.calls)


def changed(vehicle: Vehicle, values: Mapping[str, Any]) -> dict[str, ParameterValue]:
    replica = PageParameters(lambda _: None)
    replica.load(WORLD.values(), 0, descriptions=WORLD.descriptions())
    path = ParameterWriter(replica, vehicle)
    applied, _ = asyncio.run(path.change(values, "ada"))
    assert {name: replica.value(name) for name in applied} == applied
    return applied


def test_the_world_alone_is_one_call() -> None:
    vehicle = Vehicle()
    assert changed(vehicle, {GUST: 2.0, DRAG: 0.5}) == {GUST: 2.0, DRAG: 0.5}
    assert vehicle.calls == [{GUST, DRAG}]


class Mixed(PageParameters):
    """Replica with a station's parameter and one of the world."""

    def check(self, values: Mapping[str, object]) -> dict[str, ParameterValue]:
        return dict(values)  # type: ignore[arg-type]


@pytest.mark.parametrize("refused", ["", GUST])
def test_what_is_mixed_goes_apart_the_world_last(refused: str) -> None:
    vehicle = Vehicle(refused)
    path = ParameterWriter(Mixed(lambda _: None), vehicle)
    change = path.change({GUST: 2.0, LAYOUT: "wide"}, "ada")
    if refused:
        with pytest.raises(LinkError, match="all but the simulator's values were applied"):
            asyncio.run(change)
    else:
        assert asyncio.run(change) == ({LAYOUT: "wide", GUST: 2.0}, 1)
    assert vehicle.calls == [{LAYOUT}, {GUST}]
