"""Gain path: checked, coalesced, the last value always sent, confirmed values only."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping
from typing import Any

import httpx
import pytest

from quadrotor.errors import (
    LinkError,
    OutOfBoundsError,
    RefusedError,
    UnknownParameterError,
    WrongTypeError,
)
from quadrotor.parameter_description import ParameterDescription, ParameterValue
from tests.support.parameters import described
from web.parameters.replica import PageParameters
from web.parameters.writer import ParameterWriter


def check(one: ParameterDescription, value: object) -> ParameterValue:
    replica = PageParameters(lambda _: None)
    replica.load({one.name: one.default}, 0, descriptions=[one])
    return replica.check({one.name: value})[one.name]


@pytest.mark.parametrize("value", [5, 20.0, 0.0, 0.3, 4.04])
def test_numbers_within_their_bounds_pass_exactly(value: float) -> None:
    result = check(described("gains.kp"), value)
    assert result == value
    assert isinstance(result, float)


@pytest.mark.parametrize("value", [1e6, -1e6, 20.001])
def test_numbers_out_of_bounds_are_refused_with_what_is_allowed(value: float) -> None:
    with pytest.raises(OutOfBoundsError, match="allowed 0 to 20"):
        check(described("gains.kp"), value)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_refused(value: float) -> None:
    with pytest.raises(OutOfBoundsError, match="not a finite number"):
        check(described("gains.kp"), value)


@pytest.mark.parametrize("value", ["5", True, None, [5]])
def test_the_wrong_type_is_refused(value: object) -> None:
    with pytest.raises(WrongTypeError):
        check(described("gains.kp"), value)


def test_one_sided_bounds_whole_numbers_and_choices() -> None:
    assert check(described("gains.kp", maximum=None), 1e9) == 1e9
    whole = described("gains.kp", kind="int", default=3, maximum=10.0)
    assert check(whole, 9) == 9
    with pytest.raises(WrongTypeError):
        check(whole, 2.5)
    with pytest.raises(OutOfBoundsError):
        check(described("gains.kp", kind="str", default="a", choices=("a", "b")), "c")


class SlowVehicle:
    """Vehicle that applies a change only when released; it counts the calls in progress."""

    def __init__(self) -> None:
        self.calls: list[dict[str, ParameterValue]] = []
        self.under_way = 0
        self.most_under_way = 0
        self.gate = asyncio.Event()
        self.gate.set()
        self.error: Exception | None = None

    async def change_parameters(
        self, values: Mapping[str, ParameterValue], requester: str
    ) -> tuple[dict[str, ParameterValue], int]:
        self.calls.append(dict(values))
        self.under_way += 1
        self.most_under_way = max(self.most_under_way, self.under_way)
        await self.gate.wait()
        self.under_way -= 1
        if self.error is not None:
            raise self.error
        return dict(values), len(self.calls)


def path_of(vehicle: SlowVehicle, *names: str) -> tuple[ParameterWriter, PageParameters, list[Any]]:
    told: list[Any] = []
    replica = PageParameters(told.append)
    names = names or ("gains.kp",)
    replica.load(dict.fromkeys(names, 4.0), 0, descriptions=[described(name) for name in names])
    told.clear()
    return ParameterWriter(replica, vehicle), replica, told


def test_a_fast_slider_is_coalesced_and_its_last_value_arrives() -> None:
    async def scenario() -> None:
        vehicle = SlowVehicle()
        path, replica, told = path_of(vehicle)
        vehicle.gate.clear()
        first = asyncio.create_task(path.change({"gains.kp": 1.0}, "operator 1"))
        while not vehicle.calls:
            await asyncio.sleep(0)
        wishes = [{"gains.kp": 0.1 * k} for k in range(100)]
        rest = [asyncio.create_task(path.change(wish, "operator 1")) for wish in wishes]
        await asyncio.sleep(0)
        vehicle.gate.set()
        answers = await asyncio.gather(first, *rest)
        assert vehicle.calls == [{"gains.kp": 1.0}, {"gains.kp": pytest.approx(9.9)}]
        assert vehicle.most_under_way == 1
        assert answers[0] == ({"gains.kp": 1.0}, 1)
        assert all(answer[0] == {"gains.kp": pytest.approx(9.9)} for answer in answers[1:])
        assert replica.value("gains.kp") == pytest.approx(9.9)
        assert [m["value"] for m in told] == [1.0, pytest.approx(9.9)]

    asyncio.run(scenario())


def test_two_parameters_do_not_wait_for_each_other() -> None:
    async def scenario() -> None:
        vehicle = SlowVehicle()
        path, _, _ = path_of(vehicle, "a", "b")
        vehicle.gate.clear()
        both = [asyncio.create_task(path.change({name: 1.0}, "x")) for name in ("a", "b")]
        while len(vehicle.calls) < 2:
            await asyncio.sleep(0)
        assert vehicle.most_under_way == 2
        vehicle.gate.set()
        await asyncio.gather(*both)

    asyncio.run(scenario())


def test_several_at_once_are_one_call() -> None:
    async def scenario() -> None:
        vehicle = SlowVehicle()
        path, _, _ = path_of(vehicle, "a", "b")
        with pytest.raises(OutOfBoundsError, match="b = 99"):
            await path.change({"a": 1.0, "b": 99.0}, "x")
        assert vehicle.calls == []
        applied, _ = await path.change({"a": 1.0, "b": 9.0}, "x")
        assert vehicle.calls == [{"a": 1.0, "b": 9.0}]
        assert applied == {"a": 1.0, "b": 9.0}

    asyncio.run(scenario())


@pytest.mark.parametrize("error", [RefusedError("step too large"), LinkError("no answer")])
def test_a_refusal_reaches_who_asked_and_changes_nothing(error: Exception) -> None:
    async def scenario() -> None:
        vehicle = SlowVehicle()
        path, replica, told = path_of(vehicle)
        vehicle.error = error
        with pytest.raises(type(error), match=str(error)):
            await path.change({"gains.kp": 9.0}, "x")
        assert replica.value("gains.kp") == 4.0
        assert told == []
        vehicle.error = None
        assert (await path.change({"gains.kp": 9.0}, "x"))[0] == {"gains.kp": 9.0}

    asyncio.run(scenario())


def test_unknown_names_and_an_unknown_vehicle_are_said() -> None:
    replica = PageParameters(lambda _: None)
    with pytest.raises(LinkError, match="have not been read yet"):
        replica.check({"gains.kp": 1.0})
    replica.load({"gains.kp": 4.0}, 0, descriptions=[described("gains.kp")])
    with pytest.raises(UnknownParameterError, match=r"gains\.kq"):
        replica.check({"gains.kq": 1.0})


def test_pages_hear_only_news_as_of_the_flights_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("web.parameters.replica.wall_time", lambda: 86_400.0)
    told: list[Any] = []
    replica = PageParameters(told.append)
    replica.load({"gains.kp": 4.0}, 3, descriptions=[described("gains.kp")])
    replica.confirm({"gains.kp": 5.0}, "operator 1", 4)
    replica.confirm({"gains.kp": 5.0}, "operator 1", 4)  # the same again, from parameter_changes
    assert [m["type"] for m in told] == ["parameters", "parameter"]
    assert told[1] == {
        "type": "parameter",
        "name": "gains.kp",
        "old": 4.0,
        "value": 5.0,
        "requester": "operator 1",
        "revision": 4,
        "generation": replica.generation,
        "stamp": 86_400.0,
        "text": "gains.kp: 4.0 → 5.0",
    }


@pytest.fixture
def known(site: Any, station: Any, operator: httpx.Client, until: Any) -> httpx.Client:
    """Return a browser of a site whose vehicle's parameters have been read."""
    station.fly()

    def read() -> bool:
        station.fly()
        return len(operator.get("/api/parameters").json()["parameters"]) == 5

    until(read)
    return operator


def test_descriptions_are_the_vehicles_own(known: httpx.Client) -> None:
    parameters = {p["name"]: p for p in known.get("/api/parameters").json()["parameters"]}
    assert parameters["gains.kp"]["unit"] == "1/s²"
    assert (parameters["gains.kp"]["minimum"], parameters["gains.kp"]["maximum"]) == (0.0, 20.0)
    assert parameters["gains.rate"]["choices"] == ["nominal", "exact"]
    assert parameters["gains.fixed"]["read_only"] is True


def test_a_change_is_applied_and_told_with_its_requester(known: httpx.Client, station: Any) -> None:
    answer = known.put("/api/parameters", json={"values": {"gains.kp": 19.5}})
    assert answer.json()["applied"] == {"gains.kp": 19.5}
    service, request = station.requests[-1]
    assert service == "change_parameters"
    assert request.requester == known.get("/api/session").json()["label"]
    values = {p["name"]: p["value"] for p in known.get("/api/parameters").json()["parameters"]}
    assert values["gains.kp"] == 19.5
    known.put("/api/parameters", json={"values": {"gains.kp": 4.0}})


@pytest.mark.parametrize(
    ("values", "status", "text"),
    [
        ({"gains.kq": 1.0}, 422, "unknown parameter 'gains.kq'"),
        ({"gains.kp": 1e6}, 422, "gains.kp = 1e+06 is out of bounds; allowed 0 to 20"),
        ({"gains.kp": "5"}, 422, "must be a number"),
        ({"gains.exact": 1}, 422, "must be true or false"),
        ({"gains.rate": "fast"}, 422, "not one of nominal, exact"),
        ({"gains.fixed": 1.5}, 409, "cannot be changed while running"),
        ({}, 422, "values"),
    ],
)
def test_bad_values_are_refused_in_one_line(
    known: httpx.Client, values: dict[str, Any], status: int, text: str
) -> None:
    answer = known.put("/api/parameters", json={"values": values})
    assert answer.status_code == status
    assert text in answer.json()["error"]
    assert "\n" not in answer.json()["error"]


def test_every_page_hears_of_a_change(site: Any, known: httpx.Client) -> None:
    import json

    with site.websocket("/ws/events", site.cookie(known)) as page:
        assert json.loads(page.recv(timeout=10.0))["type"] == "hello"
        known.put("/api/parameters", json={"values": {"gains.kp": 7.5}})
        while (message := json.loads(page.recv(timeout=10.0)))["type"] != "parameter":
            pass
    assert (message["name"], message["value"]) == ("gains.kp", 7.5)


def test_the_stations_own_revision_does_not_hide_the_vehicles() -> None:
    replica = PageParameters(lambda _: None)
    replica.load(
        {"gains.kp": 4.0}, 3, descriptions=[described("gains.kp"), described("station.delay")]
    )
    replica.confirm({"station.delay": 0.1}, "operator 1", 99)
    assert replica.revision == 3
    replica.confirm({"gains.kp": 5.0}, "operator 1", 4)
    assert replica.revision == 4


def test_a_restarted_vehicle_is_read_again(site: Any, known: httpx.Client, until: Any) -> None:
    """Its revision starts from 0; its values are the defaults again."""
    known.put("/api/parameters", json={"values": {"gains.kp": 9.0}})
    site.station.store.preset({"gains.kp": 4.0})
    site.station.store.revision = 0
    site.station.instance += 1

    def value() -> Any:
        site.station.fly()
        parameters = known.get("/api/parameters").json()["parameters"]
        return next(p["value"] for p in parameters if p["name"] == "gains.kp")

    until(lambda: value() == 4.0)
