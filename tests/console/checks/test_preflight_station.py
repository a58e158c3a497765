"""A real station refuses to arm for its own reasons, over real sessions, and checks itself.

The vehicle is scripted and can be made unfit in each way that the station judges.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flight_log import read_log
from quadrotor.parameter_description import ParameterDescription
from quadrotor.records import TICK
from tests.support.station import LinkedStation
from tests.waiting import until
from vehicle_link.checks import Check, from_messages, to_messages
from vehicle_link.messages import decode, encode, header, new
from vehicle_link.parameters.messages import to_parameters
from vehicle_link.telemetry import pack
from vehicle_link.topics.control_inputs import encode_heartbeat, encode_joy
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.topics.ticks import odometry_messages
from vehicle_link.transport.node import Node
from vehicle_link.transport.parameter_service import serve_parameters
from vehicle_link.transport.time_sync import serve_time_sync

LIMIT = 15.0
PREFLIGHT = TOPICS["preflight"].type_name


class FitVehicle:
    """Scripted vehicle that reports to be ready, until a test changes `state`."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.armings: list[str] = []
        self.looked_at = 0
        self.refusal = ""
        self.gains = {
            f"behavior.volume_{axis}_{end}": value
            for axis in "xyz"
            for end, value in (("min", -3.0), ("max", 3.0))
        } | {"safety.battery_warning": 13.8}
        self.reset()
        self._out = {name: node.advertise(t) for name, t in TOPICS.items() if t.sender == "vehicle"}
        for name in ("arm", "disarm"):
            node.serve(name, SERVICES[name], partial(self._do, name))
        node.serve("checks", SERVICES["checks"], self._checks)
        serve_parameters(node, self)
        serve_time_sync(node, time.time_ns)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def reset(self) -> None:
        self.armed = False
        self.state: dict[str, Any] = {
            "mode": "ready",
            "flags": [],
            "voltage": 16.0,
            "innovation": 0.002,
            "age": 0.004,
            "x": 0.0,
            "tilt": 0.0,
            "body_off": 0.0,
            "revision": 1,
            "telemetry": True,
            "silent": False,
        }

    def descriptions(self) -> tuple[ParameterDescription, ...]:
        return tuple(
            ParameterDescription(n, "float", v, "", "", -100.0, 100.0, None, False, ())
            for n, v in self.gains.items()
        )

    def values(self) -> dict[str, Any]:
        if self.state["revision"] > 1:
            threading.Event().wait(2.0)  # its answer is too late
        return dict(self.gains)

    def change(self, values: Any, requester: str) -> Any:
        raise NotImplementedError

    def close(self) -> None:
        self._closing.set()
        self._thread.join(5)

    def _checks(self, request: Any) -> Any:
        self.looked_at += 1
        if self.refusal:
            return new(f"{SERVICES['checks']}_Response", accepted=False, reason=self.refusal)
        found = [
            Check("real-time rights", "fail", "refused", "SCHED_FIFO 50", "write it", "vehicle"),
            Check("version", "ok", "0123456789abcdef", place="vehicle"),
        ]
        return new(
            f"{SERVICES['checks']}_Response", accepted=True, checked=1.0, checks=to_messages(found)
        )

    def _do(self, name: str, request: Any) -> Any:
        if name == "arm":
            self.armings.append(request.requester)
        self.armed = name == "arm"
        self._status()
        return new(f"{SERVICES[name]}_Response", accepted=True)

    def _status(self) -> None:
        status = new(
            "quadlab_msgs/VehicleStatus",
            header=header(time.time_ns()),
            mode="armed" if self.armed else self.state["mode"],
            behavior="ground",
            armed=self.armed,
            flags=self.state["flags"],
            tick_rate=500.0,
            parameter_revision=self.state["revision"],
        )
        self._out["status"].put(encode(status))

    def _run(self) -> None:
        count = 0
        while not self._closing.wait(0.02):
            count += 1
            now_ns, state = time.time_ns(), dict(self.state)
            if state["silent"]:
                continue
            ticks = np.zeros(5, TICK)
            ticks["imu"]["stamp_ns"] = now_ns + 2_000_000 * np.arange(-4, 1)
            half = state["tilt"] / 2.0
            ticks["state"]["quaternion_wb"] = (math.cos(half), math.sin(half), 0.0, 0.0)
            ticks["state"]["position_w"][:, 0] = state["x"]
            up = state["tilt"] + state["body_off"]
            ticks["imu"]["specific_force_b"] = (0.0, 9.8 * math.sin(up), 9.8 * math.cos(up))
            if state["telemetry"]:
                self._out["telemetry"].put(pack(ticks, count), now_ns)
            self._out["vehicle_heartbeat"].put(encode_heartbeat(count, now_ns), now_ns)
            if count % 5 == 0:
                estimator = new(
                    "quadlab_msgs/EstimatorStatus",
                    measurement_age=state["age"],
                    position_innovation=(state["innovation"], 0.0, 0.0),
                )
                self._out["estimator"].put(encode(estimator))
                battery = new("sensor_msgs/BatteryState", voltage=state["voltage"])
                self._out["battery"].put(encode(battery))
                self._status()


class Bench(LinkedStation):
    """Vehicle, station, tracking system and page, connected."""

    def __init__(self, data: Path) -> None:
        settings = {
            "station.recorder.after_disarm": 0.0,
            "station.recorder.keep_free": 10.0,
            # The rate that a busy computer achieves in one thread.
            "station.preflight.telemetry_rate_min": 5.0,
            "station.tracker.rate": 10.0,
        }
        super().__init__(data, settings)
        self.vehicle = FitVehicle(self.at_vehicle)
        self.stick = self.page.advertise(TOPICS["stick"])
        self.lists: list[Any] = []
        self.told: list[Any] = []
        self.page.subscribe("preflight", PREFLIGHT, lambda r: self.lists.append(r.payload))
        kind = TOPICS["experiment_status"].type_name
        self.page.subscribe(
            "experiment_status", kind, lambda r: self.told.append(decode(r.payload, kind))
        )
        self._truth = self.page.advertise(TOPICS["truth"])
        self.tracked, self._deflection = True, 0.0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def deflect(self, forward: float) -> None:
        self._deflection = forward

    def _run(self) -> None:
        while not self._closing.wait(0.02):
            now_ns = time.time_ns()
            state = np.zeros(1, TICK)["state"]
            state["quaternion_wb"] = (1, 0, 0, 0)
            if self.tracked:
                self._truth.put(odometry_messages(np.array([now_ns]), state).tobytes(), now_ns)
            if self._deflection:
                axes = (self._deflection, 0.0, 0.0, 0.0)
                self.stick.put(encode_joy(now_ns, axes, False), now_ns)

    @property
    def newest(self) -> Any:
        return decode(self.lists[-1], PREFLIGHT) if self.lists else None

    def state(self, name: str) -> str:
        found = [one for one in self.newest.checks if one.name == name]
        return found[0].state if found else ""

    def ready(self) -> bool:
        return bool(self.newest and self.newest.ready and not self.newest.armed)

    def fit(self) -> None:
        """Make everything fit again, and wait until the station sees it."""
        self.vehicle.reset()
        self.tracked, self._deflection = True, 0.0
        self.station.parts.alarms.set("defect", None)
        assert until(self.ready), self.newest

    def close(self) -> None:
        self._closing.set()
        self._thread.join(5)
        self.vehicle.close()
        super().close()


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    bench = Bench(tmp_path_factory.mktemp("data"))
    assert until(bench.ready), bench.newest
    yield bench
    bench.close()


@pytest.fixture
def bench(running: Bench) -> Iterator[Bench]:
    yield running
    running.fit()


UNFIT: list[tuple[str, Callable[[Bench], Any]]] = [
    ("telemetry", lambda b: b.vehicle.state.update(telemetry=False)),
    ("mode", lambda b: b.vehicle.state.update(mode="cut")),
    ("gyroscope", lambda b: b.vehicle.state.update(flags=["gyro_uncalibrated"])),
    ("estimator", lambda b: b.vehicle.state.update(innovation=0.4)),
    ("measurements", lambda b: b.vehicle.state.update(age=0.5)),
    ("measurements", lambda b: setattr(b, "tracked", False)),
    ("battery", lambda b: b.vehicle.state.update(voltage=13.0)),
    ("level and still", lambda b: b.vehicle.state.update(tilt=0.4)),
    ("tracked body", lambda b: b.vehicle.state.update(body_off=1.5)),
    ("flight volume", lambda b: b.vehicle.state.update(x=4.0)),
    ("parameters", lambda b: b.vehicle.state.update(revision=2)),
    ("alarms", lambda b: b.station.parts.alarms.set("defect", "a defect of the station")),
    ("sticks", lambda b: b.deflect(0.5)),
]


@pytest.mark.parametrize(("name", "spoil"), UNFIT)
def test_the_station_refuses_to_arm_with_the_reason_and_the_vehicle_is_not_asked(
    bench: Bench, name: str, spoil: Callable[[Bench], Any]
) -> None:
    spoil(bench)
    assert until(lambda: bench.state(name) == "fail"), bench.newest
    assert not bench.newest.ready
    asked = len(bench.vehicle.armings)
    answer = bench.call("arm")
    assert not answer.accepted
    assert answer.reason.startswith("not armed: ")
    assert f"{name}: " in answer.reason
    assert len(bench.vehicle.armings) == asked


def test_all_reasons_are_said_in_one_line(bench: Bench) -> None:
    bench.vehicle.state.update(voltage=13.0, mode="cut", x=4.0)
    failing = ("battery", "mode", "flight volume")
    assert until(lambda: all(bench.state(name) == "fail" for name in failing))
    reason = bench.call("arm").reason
    assert all(f"{name}: " in reason for name in failing)
    assert "\n" not in reason


def test_an_experiment_is_refused_as_a_person_is(bench: Bench) -> None:
    bench.vehicle.state.update(voltage=13.0)
    assert until(lambda: bench.state("battery") == "fail")
    asked = len(bench.vehicle.armings)
    assert bench.call("experiment", action="start", name="hover").accepted
    assert until(lambda: bench.told and bench.told[-1].phase == "refused"), bench.told[-1]
    assert "battery: 13.0 V" in bench.told[-1].reason
    assert len(bench.vehicle.armings) == asked


def test_of_a_ready_vehicle_the_list_at_arming_is_in_the_log_of_its_flight(bench: Bench) -> None:
    bench.vehicle.state.update(flags=["not_real_time"])  # only a warning
    assert until(lambda: bench.state("flight loop") == "warn")
    assert bench.newest.ready
    assert bench.call("arm").accepted
    assert bench.vehicle.armings[-1] == "ada"
    run_id = until(lambda: bench.station.runs.recorder.run_id)
    bench.vehicle.state.update(voltage=12.0)  # in flight: the value at arming remains
    count = len(bench.lists)
    assert until(lambda: len(bench.lists) >= count + 3)
    assert bench.newest.armed
    assert bench.call("disarm").accepted
    assert until(lambda: not bench.station.runs.recorder.run_id)
    assert bench.station.runs.recorder.wait_idle(LIMIT)
    logged = [
        decode(one.payload, PREFLIGHT)
        for one in read_log(bench.catalogue.resolve(run_id))
        if one.topic == "/quad1/preflight"
    ]
    armed = [one for one in logged if one.armed]
    assert armed
    for one in armed:
        assert one.ready
        states = {check.name: check.state for check in one.checks}
        assert states["flight loop"] == "warn"
        assert states["battery"] == "ok"


def test_an_armed_vehicle_answers_for_itself(bench: Bench) -> None:
    """A command repeated because its answer was lost must not be refused because of the flight."""
    assert bench.call("arm").accepted
    assert until(lambda: bench.newest.armed)
    bench.vehicle.state.update(voltage=12.0)
    assert bench.call("arm").accepted
    assert bench.call("disarm").accepted


def test_that_it_blocks_is_decided_at_the_start(bench: Bench) -> None:
    values = to_parameters({"station.preflight.blocks": False})
    answer = bench.call("change_parameters", parameters=values)
    assert not answer.accepted
    assert bench.newest.blocks


def test_the_station_has_looked_at_itself_and_the_vehicle_by_itself(bench: Bench) -> None:
    assert until(lambda: bench.call("checks", again=False).checked > 0.0)
    answer = bench.call("checks", again=False)
    found = {(one.place, one.name): one for one in from_messages(answer.checks)}
    assert {
        "clock",
        "clock jumps",
        "vehicle's clock",
        "telemetry",
        "flight loop",
        "tracker",
        "bearings",
        "runs' disk",
        "disk's speed",
        "processor",
        "link's certificate",
        "libraries",
    } <= {name for place, name in found if place == "station"}
    assert found["vehicle", "real-time rights"].state == "fail"
    version = found["vehicle", "version"]
    assert (version.state, version.found) == ("warn", "0123456789")
    assert not list(bench.catalogue.folder.glob(".speed"))


def test_checks_are_made_again_when_asked_and_never_in_flight(bench: Bench) -> None:
    before = bench.vehicle.looked_at
    answer = bench.call("checks", again=True)
    assert answer.accepted
    assert bench.vehicle.looked_at == before + 1
    assert bench.call("arm").accepted
    assert until(lambda: bench.newest.armed)
    refused = bench.call("checks", again=True)
    assert not refused.accepted
    assert "on the ground" in refused.reason
    assert bench.vehicle.looked_at == before + 1
    assert bench.call("checks", again=False).checked == answer.checked
    assert bench.call("disarm").accepted


def test_while_an_armed_vehicle_is_not_heard_the_disk_is_left_alone(bench: Bench) -> None:
    assert bench.call("arm").accepted
    assert until(lambda: bench.newest.armed)
    bench.vehicle.state.update(silent=True)
    assert until(lambda: bench.station.parts.preflight._facts().mode is None)
    answer = bench.call("checks", again=True)
    assert answer.accepted
    found = {one.name: one for one in from_messages(answer.checks) if one.place == "station"}
    speed = found["disk's speed"]
    assert speed.state == "unknown"
    assert speed.found == "not measured: the vehicle sends nothing, and may be flying"
    assert found["runs' disk"].state != "unknown"
    bench.vehicle.state.update(silent=False)
    assert until(lambda: bench.call("disarm").accepted)  # once the link is good again
    assert until(lambda: bench.station.parts.preflight._facts().mode == "ready")
    again = from_messages(bench.call("checks", again=True).checks)
    assert next(one for one in again if one.name == "disk's speed").found.endswith("MB/s")


def test_a_vehicle_that_refuses_its_checks_is_a_line_with_its_reason(bench: Bench) -> None:
    bench.vehicle.refusal = "the vehicle is armed; checks are made on the ground"
    found = from_messages(bench.call("checks", again=True).checks)
    bench.vehicle.refusal = ""
    [line] = [one for one in found if one.place == "vehicle"]
    assert (line.name, line.state) == ("vehicle", "unknown")
    assert line.found == "the vehicle is armed; checks are made on the ground"
