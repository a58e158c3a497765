"""History, presets and files of parameters, over HTTP."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from console.catalogue.catalogue import Catalogue
from console.parameters.history import ParameterHistory, RecordedChange
from quadlab.simulated.parameters import FlightParameters
from quadrotor.parameters import Parameters, ParameterStore, parameter
from vehicle.parameters import new_parameters
from web.parameters.built_in_presets import built_in
from web.parameters.file import read_file, write_file
from web.parameters.replica import PageParameters

DEFAULTS = {"gains.kp": 4.0, "gains.laps": 3, "gains.exact": False, "gains.rate": "nominal"}


@pytest.fixture
def known(site: Any, station: Any, operator: httpx.Client, until: Any) -> Iterator[httpx.Client]:
    """Yield a browser of a site whose vehicle's parameters have been read and are the defaults."""

    def read() -> bool:
        station.fly()
        return len(operator.get("/api/parameters").json()["parameters"]) == 5

    until(read)
    operator.put("/api/parameters", json={"values": DEFAULTS})
    yield operator
    station.refusal = ""
    operator.put("/api/parameters", json={"values": DEFAULTS})


@pytest.fixture(scope="module")
def history(site: Any) -> ParameterHistory:
    """Write a history as the station does: two changes on the ground, a flight with two more."""
    history = ParameterHistory(Catalogue(site.data).engine, "quad1")
    steps = [("gains.kp", 4.0, 5.0), ("gains.laps", 3, 4), ("gains.kp", 5.0, 6.0)]
    for k, (name, old, value) in enumerate(steps, 1):
        flight = "run7" if k == 3 else ""
        if flight:
            history.begin_flight(flight, 7_000_000_000)
        history.add([RecordedChange(name, old, value, "anna", k * 10**9, k, flight, k)])
    history.add([RecordedChange("beacons.layout", "paper", "wide", "anna", 9, 9, "run7", 9)])
    return history


def names(answer: httpx.Response) -> list[tuple[str, Any]]:
    return [(c["name"], c["new"]) for c in answer.json()["changes"]]


def test_the_history_is_read_newest_first_by_name_by_flight_and_page_by_page(
    known: httpx.Client, history: ParameterHistory
) -> None:
    answer = known.get("/api/parameters/history", params={"limit": 3})
    expected = [("beacons.layout", "wide"), ("gains.kp", 6.0), ("gains.laps", 4)]
    assert names(answer) == expected
    last = answer.json()["changes"][-1]
    assert (last["who"], last["old"], last["stamp"], last["flight"]) == ("anna", 3, 2.0, "")

    def ask(**params: Any) -> list[tuple[str, Any]]:
        return names(known.get("/api/parameters/history", params=params))

    assert ask(before=last["id"]) == [("gains.kp", 5.0)]
    assert ask(name="gains.kp") == [("gains.kp", 6.0), ("gains.kp", 5.0)]
    assert ask(flight="run7", name="gains.kp") == [("gains.kp", 6.0)]
    assert ask(flight="ground") == [("gains.laps", 4), ("gains.kp", 5.0)]


@pytest.mark.parametrize("params", [{"limit": 0}, {"limit": 10**6}, {"before": -1}])
def test_the_history_has_bounds(known: httpx.Client, params: dict[str, int]) -> None:
    assert known.get("/api/parameters/history", params=params).status_code == 422


def test_back_to_before_the_flight_shows_what_it_would_change_but_moves_no_beacons(
    known: httpx.Client, history: ParameterHistory
) -> None:
    known.put("/api/parameters", json={"values": {"gains.kp": 6.0}})
    flight = known.get("/api/parameters/flight").json()
    assert (flight["run"], flight["start"], flight["is_over"]) == ("run7", 7.0, False)
    assert flight["values"] == {"gains.kp": 5.0, "beacons.layout": "paper"}
    [line] = flight["lines"]
    assert (line["name"], line["now"], line["new"], line["reason"]) == ("gains.kp", 6.0, 5.0, "")


def test_a_preset_is_saved_by_who_compared_switched_to_deleted_and_restored(
    known: httpx.Client, station: Any
) -> None:
    label = known.get("/api/session").json()["label"]
    known.put("/api/parameters", json={"values": {"gains.kp": 9.0, "gains.laps": 5}})
    body = {"name": "fast", "parameters": ["gains.kp", "gains.laps"]}
    saved = known.post("/api/parameters/presets", json=body).json()
    assert (saved["name"], saved["who"], saved["built_in"]) == ("fast", label, False)
    assert known.post("/api/parameters/presets", json=body).status_code == 409
    known.put("/api/parameters", json={"values": DEFAULTS})

    listed = {p["name"]: p for p in known.get("/api/parameters/presets").json()["presets"]}
    assert (listed["fast"]["count"], listed["fast"]["differs"]) == (2, 2)
    assert listed["defaults"]["built_in"] is True
    lines = known.get(f"/api/parameters/presets/{saved['id']}").json()["lines"]
    assert {line["name"]: (line["now"], line["new"]) for line in lines} == {
        "gains.kp": (4.0, 9.0),
        "gains.laps": (3, 5),
    }
    station.requests.clear()
    values = {line["name"]: line["new"] for line in lines}
    known.put("/api/parameters", json={"values": values, "walks": True})
    assert len(station.requests) == 1, "one atomic change"

    assert known.delete(f"/api/parameters/presets/{saved['id']}").status_code == 200
    assert known.get(f"/api/parameters/presets/{saved['id']}").status_code == 409
    restored = known.post(f"/api/parameters/presets/{saved['id']}/restore")
    assert restored.json()["name"] == "fast"
    known.delete(f"/api/parameters/presets/{saved['id']}")


@pytest.mark.parametrize(
    ("body", "status", "text"),
    [
        ({"name": "defaults", "parameters": ["gains.kp"]}, 409, "built-in"),
        ({"name": "x", "parameters": ["gains.kq"]}, 422, "unknown parameter 'gains.kq'"),
        ({"name": "a\nb", "parameters": ["gains.kp"]}, 422, "name"),
        ({"name": "", "parameters": ["gains.kp"]}, 422, "name"),
        ({"name": "x", "parameters": []}, 422, "parameters"),
    ],
)
def test_a_bad_preset_is_refused_in_one_line(
    known: httpx.Client, body: dict[str, Any], status: int, text: str
) -> None:
    answer = known.post("/api/parameters/presets", json=body)
    assert answer.status_code == status
    assert text in answer.json()["error"]


@pytest.mark.parametrize("preset", ["nothing", "9" * 30, "1/../2", "-1"])
def test_a_preset_that_is_none_is_said(known: httpx.Client, preset: str) -> None:
    assert known.get(f"/api/parameters/presets/{preset}").status_code in (404, 409)


def test_a_saved_file_loads_to_the_same_values(known: httpx.Client) -> None:
    known.put("/api/parameters", json={"values": {"gains.kp": 7.25, "gains.rate": "exact"}})
    saved = known.get("/api/parameters/file")
    assert "attachment" in saved.headers["content-disposition"]
    assert "kp = 7.25  # 1/s², 0 to 20, default 4: position gain" in saved.text
    read = tomllib.loads(saved.text)
    assert read["gains"] == {"kp": 7.25, "laps": 3, "exact": False, "rate": "exact"}
    modified = known.get("/api/parameters/file", params={"which": "modified"}).text
    assert tomllib.loads(modified) == {"gains": {"kp": 7.25, "rate": "exact"}}
    known.put("/api/parameters", json={"values": DEFAULTS})
    compared = known.post("/api/parameters/file", content=saved.content).json()
    assert [line["name"] for line in compared["lines"]] == ["gains.kp", "gains.rate"]
    assert compared["same"] == 2


def test_a_file_is_only_compared_and_every_bad_line_says_why(
    known: httpx.Client, station: Any
) -> None:
    station.requests.clear()
    text = (
        "[gains]\nkp = 99.0\nlaps = 'five'\nexact = true\nrate = 'fast'\nfixed = 2.0\nold = 1\n"
        "list = [1, 2]\nnever = nan\nday = 2026-01-31\n"
    )
    answer = known.post("/api/parameters/file", content=text.encode())
    lines = {line["name"]: line for line in answer.json()["lines"]}
    reasons = {name.removeprefix("gains."): line["reason"] for name, line in lines.items()}
    assert reasons.pop("exact") == ""
    assert "out of bounds; allowed 0 to 20" in reasons["kp"]
    assert "must be a number" in reasons["laps"]
    assert "not one of nominal, exact" in reasons["rate"]
    assert "--set gains.fixed=2.0" in reasons["fixed"]
    assert all("unknown parameter" in reasons[k] for k in ("old", "list", "never", "day"))
    assert station.requests == []


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"kp: 4", "not a TOML file"),
        (b"\xff\xfe", "not a TOML file"),
        (b"#" * 300_000, "too large"),
        (b"a." * 100_000 + b"a = 1", "32 parts"),
        (b'x = {"a b" . ' + b"'c' ." * 40_000 + b"d = 1}", "32 parts"),
        (b"x = " + b"[" * 100_000, "not a TOML file"),
    ],
)
def test_what_is_no_file_of_parameters_is_refused(
    known: httpx.Client, content: bytes, text: str
) -> None:
    answer = known.post("/api/parameters/file", content=content)
    assert answer.status_code == 422
    assert text in answer.json()["error"]


def test_every_parameter_of_the_vehicle_comes_back_from_a_file_exactly() -> None:
    store = ParameterStore(new_parameters())
    store.set({"beacons.layout": "1 0 0 0; 2 1 0 0; 3 0 1 0; 4 1 1 0", "imu.gyroscope_scale": 1e-3})
    assert (
        read_file(write_file(store.descriptions(), store.values(), "x").encode()) == store.values()
    )


def test_a_text_with_everything_in_it_comes_back() -> None:
    class One(Parameters):
        text: str = parameter("\"quoted\" \\ 'x' \t\n ü # no comment \x7f", description="a\nb")

    class Root(Parameters):
        a: One = One()

    store = ParameterStore(Root())
    assert read_file(write_file(store.descriptions(), store.values(), "two\nlines").encode()) == (
        store.values()
    )


def test_built_in_presets_name_parameters_of_the_vehicle_and_leave_what_was_measured() -> None:
    replica, store = PageParameters(lambda _: None), ParameterStore(new_parameters())
    replica.load(store.values(), 0, descriptions=store.descriptions())
    sets = built_in(replica)
    assert {"control standard", "control stiff", "estimation paper", "defaults"} <= sets.keys()
    for values in sets.values():
        assert replica.check(values).keys() == values.keys()
        assert not any(name.startswith(("model.", "imu.")) for name in values)
        assert "beacons.layout" not in values
    assert sets["control stiff"]["control.position.kp_xy"] == 6.0
    assert sets["control stiff"]["control.position.kp_z"] == 8.0, "the whole set, not a patch"
    assert sets["control observer"]["control.disturbance.torque"] is True
    assert sets["control standard"]["control.disturbance.torque"] is False
    assert "simulator defaults" not in sets, "there is no simulator"


def test_the_defaults_of_a_simulated_world_are_a_preset_of_their_own() -> None:
    replica, store = PageParameters(lambda _: None), ParameterStore(FlightParameters())
    replica.load(store.values(), 0, descriptions=store.descriptions())
    sets = built_in(replica)
    assert sets["simulator defaults"]["simulator.gust"] == 0.0
    assert all(name.startswith("simulator.") for name in sets["simulator defaults"])
    assert not any(name.startswith("simulator.") for name in sets["defaults"])
