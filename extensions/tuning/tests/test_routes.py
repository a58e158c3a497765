"""Step tests over the page's API: flown, fetched, judged, stored, deleted, and their gains set."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from vehicle_link.parameters.messages import from_parameters

KP = "control.position.kp_xy"


@pytest.fixture
def bench(tune_site: Any, until: Any) -> Iterator[Bench]:
    made = Bench(tune_site, until)
    yield made
    made.close()


class Bench:
    def __init__(self, site: Any, until: Any) -> None:
        self.site, self.until, self.vehicle = site, until, site.vehicle
        self.admin: httpx.Client = site.sign_in()
        until(lambda: KP in {p["name"] for p in self.get("/api/parameters")["parameters"]})
        site.station.requests.clear()

    def get(self, path: str) -> Any:
        answer = self.admin.get(path)
        assert answer.status_code == 200, answer.text
        return answer.json()

    @property
    def status(self) -> dict[str, Any]:
        found: dict[str, Any] = self.get("/api/tuning")["status"]
        return found

    def run(self, **body: Any) -> dict[str, Any]:
        """Run one test to its end; return its result."""
        before = self.status["id"]
        answer = self.admin.post("/api/tuning/run", json=body)
        assert answer.status_code == 200, answer.text
        self.until(lambda: self.ended(before))
        return self.status

    def ended(self, before: str) -> bool:
        status = self.status
        done = status["phase"] == "done" and status["id"] != before
        return bool(status["phase"] == "failed" or done)

    def newest(self) -> dict[str, Any]:
        found: dict[str, Any] = self.get("/api/tuning")["runs"][0]
        return found

    def close(self) -> None:
        self.until(lambda: self.status["phase"] in ("idle", "done", "failed"))
        vehicle = self.vehicle
        vehicle.behavior, vehicle.airborne, vehicle.log_problem = "hover", True, ""
        vehicle.ends_with, vehicle.ends_after, vehicle.lose = "hover", math.inf, None
        self.site.station.refusal = ""
        self.admin.close()


def test_a_test_is_flown_fetched_judged_and_kept(bench: Bench) -> None:
    status = bench.run(axis="x", amplitude=0.3, duration=2.0)
    assert (status["phase"], status["text"]) == ("done", "")
    run = bench.newest()
    assert run["id"] == status["id"]
    assert run["requester"] == bench.admin.get("/api/session").json()["label"]
    assert run["plan"] == {
        "axis": "x",
        "shape": "step",
        "amplitude": 0.3,
        "duration": 2.0,
        "repeats": 1,
    }
    assert run["gains"][KP] == 4.0
    assert set(run["gains"]) == {n for n in bench.site.station.store.values() if "control." in n}
    # zeta 0.5, omega 2 rad/s
    assert run["figures"]["overshoot"] == pytest.approx(16.3, abs=1.0)
    assert run["figures"]["rise"] == pytest.approx(0.82, abs=0.03)
    [start] = [r for s, r in bench.site.station.requests if s == "start_behavior"]
    assert (start.name, start.requester) == ("excite", "admin 1")
    assert from_parameters(start.arguments)["amplitude"] == 0.3
    asked = [r for s, r in bench.site.station.requests if s == "onboard_log"]
    assert len(asked) > 5, "in chunks"
    assert {r.requester for r in asked} == {"admin 1"}
    drawn = bench.get(f"/api/tuning/runs/{run['id']}")
    assert len(drawn["time"]) == len(drawn["setpoint"]) == len(drawn["actual"])
    assert drawn["time"][1] - drawn["time"][0] == pytest.approx(0.002)
    assert max(drawn["setpoint"]) == pytest.approx(0.3)


def test_gaps_are_said_and_drawn(bench: Bench) -> None:
    bench.vehicle.lose = (900, 949)
    status = bench.run(axis="y", amplitude=0.3, duration=1.0)
    assert "1 gap in the vehicle's log, 102 ms" in status["text"]
    run = bench.newest()
    assert run["edges"][0]["rise"] is None
    drawn = bench.get(f"/api/tuning/runs/{run['id']}")
    assert drawn["actual"].count(None) == 1
    assert drawn["setpoint"].count(None) == 1


def test_a_log_that_cannot_be_read_fails_and_nothing_is_kept(bench: Bench) -> None:
    count = len(bench.get("/api/tuning")["runs"])
    bench.vehicle.log_problem = "there is no onboard log of this flight: the disk is full"
    status = bench.run(axis="x", amplitude=0.3, duration=0.5)
    assert status["phase"] == "failed"
    assert "the vehicle's log could not be read" in status["text"]
    assert "the disk is full" in status["text"]
    assert len(bench.get("/api/tuning")["runs"]) == count


def test_a_test_that_is_ended_early_says_by_what(bench: Bench) -> None:
    bench.vehicle.ends_with, bench.vehicle.ends_after = "brake", 0.7
    status = bench.run(axis="z", amplitude=0.3, duration=1.0)
    assert "it ended early: 1 of 2 edges were flown" in status["text"]
    assert "it was stopped by brake" in status["text"]


def test_gains_changed_in_flight_are_marked(bench: Bench) -> None:
    body = {"axis": "x", "amplitude": 0.3, "duration": 2.0}
    before = bench.status["id"]
    assert bench.admin.post("/api/tuning/run", json=body).status_code == 200
    again = bench.admin.post("/api/tuning/run", json=body)
    assert (again.status_code, "is running" in again.text) == (409, True)
    changed = bench.admin.put("/api/parameters", json={"values": {KP: 5.0}})
    assert changed.status_code == 200, changed.text
    bench.until(lambda: bench.ended(before))
    run = bench.newest()
    assert run["changed"] == [KP]
    assert run["gains"][KP] == 4.0
    assert f"changed while it flew: {KP}" in run["problems"]


def test_the_gains_of_a_test_are_put_back_on_the_way_of_every_gain(bench: Bench) -> None:
    bench.admin.put("/api/parameters", json={"values": {KP: 4.0}})
    first = bench.run(axis="x", amplitude=0.3, duration=0.5)["id"]
    bench.admin.put("/api/parameters", json={"values": {KP: 6.0, "control.position.kv_xy": 4.0}})
    answer = bench.admin.post(f"/api/tuning/runs/{first}/gains", json={}).json()
    assert answer["applied"] == {KP: 4.0, "control.position.kv_xy": 3.5}
    assert answer["left"] == []
    assert bench.site.station.store.get(KP) == 4.0
    again = bench.admin.post(f"/api/tuning/runs/{first}/gains", json={})
    assert (again.status_code, "in force already" in again.text) == (409, True)


def test_a_deleted_test_comes_back(bench: Bench) -> None:
    made = bench.run(axis="yaw", amplitude=0.3, duration=0.5)["id"]
    assert bench.admin.delete(f"/api/tuning/runs/{made}").status_code == 200
    assert made not in [run["id"] for run in bench.get("/api/tuning")["runs"]]
    assert bench.admin.get(f"/api/tuning/runs/{made}").status_code == 404
    assert bench.admin.post(f"/api/tuning/runs/{made}/restore", json={}).status_code == 200
    assert bench.newest()["id"] == made


def test_what_the_vehicle_refuses_is_answered_and_nothing_begins(bench: Bench) -> None:
    bench.site.station.refusal = "excite refused: not at rest"
    before = bench.status
    answer = bench.admin.post("/api/tuning/run", json={})
    assert (answer.status_code, answer.json()["error"]) == (409, "excite refused: not at rest")
    assert bench.status == before


@pytest.mark.parametrize(
    "body",
    [
        {"axis": "roll"},
        {"shape": "ramp"},
        {"amplitude": 7},
        {"duration": 0.1},
        {"repeats": 6},
        {"speed": 1},
        {"amplitude": "much"},
    ],
)
def test_a_body_out_of_bounds_is_answered_with_what_is_allowed(bench: Bench, body: Any) -> None:
    answer = bench.admin.post("/api/tuning/run", json=body)
    assert answer.status_code == 422
    assert next(iter(body)) in answer.json()["error"]
    assert json.dumps(bench.site.station.requests) == "[]"


@pytest.mark.parametrize("name", ["nobody", "..%2f..%2fweb%2faccess", "20260101T000000000Z_quad1"])
def test_an_unknown_test_is_not_found(bench: Bench, name: str) -> None:
    assert bench.admin.get(f"/api/tuning/runs/{name}").status_code == 404
    assert bench.admin.delete(f"/api/tuning/runs/{name}").status_code in (404, 405)
