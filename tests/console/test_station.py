"""The station between a vehicle and a page, each in a separate Zenoh session."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.catalogue.catalogue import Catalogue
from flight_log import LogWriter, is_closed, read_attachments, read_log, read_metadata
from flight_log.run_folder import run_bytes
from quadrotor.errors import LinkError, NoAnswerError, ParameterError
from quadrotor.parameter_description import ParameterDescription, ParameterValue
from quadrotor.records import TICK, Record, beacon_ids_of
from tests.support.station import LinkedStation
from tests.waiting import free_port, until
from vehicle_link.commands import COMMANDS
from vehicle_link.messages import decode, encode, header, new, stamp_of
from vehicle_link.messages.cdr_layout import payloads_of
from vehicle_link.parameters.messages import from_parameters, from_value, to_parameters
from vehicle_link.telemetry import pack, unpack
from vehicle_link.topics.control_inputs import (
    decode_heartbeat,
    decode_joy,
    encode_heartbeat,
    encode_joy,
)
from vehicle_link.topics.measurements import decode_bearings, decode_pose
from vehicle_link.topics.status import encode_event
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.topics.ticks import odometry_messages
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.parameter_service import ParameterClient, serve_parameters
from vehicle_link.transport.publisher import Received
from vehicle_link.transport.time_sync import serve_time_sync

LIMIT = 15.0
CALL_TIMEOUT = COMMANDS["change_parameters"].patience
AHEAD_NS = 40_000_000_000
"""The fake vehicle's clock is 40 s ahead of the station's."""


def vehicle_now() -> int:
    return time.time_ns() + AHEAD_NS


class Inbox:
    """Receiver of what a node subscribes to."""

    def __init__(self, node: Node, *names: str) -> None:
        self.got: dict[str, list[Received]] = {name: [] for name in names}
        for name in names:
            node.subscribe(name, TOPICS[name].type_name, self.got[name].append)

    def decoded(self, name: str) -> list[Any]:
        return [decode(r.payload, TOPICS[name].type_name) for r in list(self.got[name])]


class FakeVehicle:
    """The vehicle's end of the link: it answers, sends heartbeats, and what the test requests."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.requests: list[tuple[str, Any]] = []
        self.refusal = ""
        self.answering = threading.Event()
        self.answering.set()
        self.lost_answers = 0  # of the next changes: they arrive later than any caller waits
        self.armed = False
        self.revision = 0
        self.sequence = 0
        self.gains: dict[str, ParameterValue] = {"position.kp_xy": 4.0}
        self._out = {name: node.advertise(t) for name, t in TOPICS.items() if t.sender == "vehicle"}
        for name in ("arm", "disarm", "start_behavior", "emergency"):
            node.serve(name, SERVICES[name], partial(self._answer, name))
        node.serve("change_parameters", SERVICES["change_parameters"], self._change)
        serve_parameters(node, self)
        serve_time_sync(node, vehicle_now)
        self.inbox = Inbox(node, "tracker_pose", "bearings", "joy", "station_heartbeat")
        self._closing = threading.Event()
        self._sending = threading.Lock()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def descriptions(self) -> tuple[ParameterDescription, ...]:
        return tuple(
            ParameterDescription(n, "float", v, "", "", 0.0, 20.0, None, False, ())
            for n, v in self.gains.items()
        )

    def values(self) -> dict[str, Any]:
        return dict(self.gains)

    def change(self, values: Any, requester: str) -> Any:
        raise ParameterError("not here")

    def close(self) -> None:
        self._closing.set()
        self._thread.join(5)

    def put(self, name: str, payload: bytes, stamp_ns: int | None = None) -> None:
        self._out[name].put(payload, vehicle_now() if stamp_ns is None else stamp_ns)

    def send_telemetry(self, newest_ns: int | None = None) -> Record:
        """Send telemetry, by the test and by a thread in turns, in the order of the stamps."""
        with self._sending:
            newest_ns = vehicle_now() if newest_ns is None else newest_ns
            ticks = np.zeros(5, TICK)
            ticks["imu"]["stamp_ns"] = newest_ns + 2_000_000 * np.arange(-4, 1)
            ticks["state"]["quaternion_wb"][:, 0] = 1
            ticks["state"]["position_w"][:, 0] = self.sequence
            self.put("telemetry", pack(ticks, self.sequence), newest_ns)
            self.sequence += 1
        return ticks

    def send_status(self) -> None:
        status = new(
            "quadlab_msgs/VehicleStatus", armed=self.armed, parameter_revision=self.revision
        )
        self.put("status", encode(status))

    def _answer(self, name: str, request: Any) -> Any:
        self.requests.append((name, request))
        self.answering.wait(LIMIT)
        if name == "arm" and not self.refusal:
            self.armed = True
        if name == "disarm":
            self.armed = False
        self.send_status()
        return new(f"{SERVICES[name]}_Response", accepted=not self.refusal, reason=self.refusal)

    def _change(self, request: Any) -> Any:
        self.requests.append(("change_parameters", request))
        if self.lost_answers:
            self.lost_answers -= 1
            self._closing.wait(1.2 * CALL_TIMEOUT)
        self.revision += 1
        self.gains.update(from_parameters(request.parameters))
        return new(
            f"{SERVICES['change_parameters']}_Response",
            accepted=True,
            applied=request.parameters,
            revision=self.revision,
        )

    def _run(self) -> None:
        count = 0
        while not self._closing.wait(0.05):
            count += 1
            now_ns = vehicle_now()
            self.put("vehicle_heartbeat", encode_heartbeat(count, now_ns), now_ns)
            self.send_telemetry()
            if count % 2 == 0:
                self.send_status()


class Bench(LinkedStation):
    """Vehicle, station and page, connected."""

    def __init__(self, data: Path) -> None:
        self.data = data
        settings = {
            "station.recorder.after_disarm": 0.0,
            "station.recorder.keep_free": 10.0,
            "station.preflight.blocks": False,
        }
        super().__init__(data, settings, operator="the lab")
        self.vehicle = FakeVehicle(self.at_vehicle)
        self.inbox = Inbox(
            self.page,
            "state",
            "ticks",
            "station_status",
            "link_status",
            "events",
            "parameter_changes",
            "control",
        )
        self.truth = self.page.advertise(TOPICS["truth"])
        self.stick = self.page.advertise(TOPICS["stick"])

    def ready(self) -> bool:
        known = self.station.link.clock_known
        return bool(known and self.inbox.got["state"] and self.inbox.got["link_status"])

    def close(self) -> None:
        self.vehicle.close()
        super().close()

    def free_control(self) -> None:
        for action in ("take", "release"):
            assert self.call("control", action=action).accepted

    def recording(self) -> str:
        return self.station.runs.recorder.run_id

    def send_truth(self, position: tuple[float, float, float], stamp_ns: int) -> None:
        state = np.zeros(1, TICK)["state"]
        state["position_w"], state["quaternion_wb"] = position, (1, 0, 0, 0)
        [payload] = payloads_of(odometry_messages(np.array([stamp_ns]), state))
        self.truth.put(payload, stamp_ns)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    data = tmp_path_factory.mktemp("data")
    torn = data / "runs" / "torn.mcap"
    with LogWriter(torn, {"vehicle": "quad1"}, {}) as log:
        for i in range(50):
            log.write("/a", "std_msgs/String", bytes(100), i * 50_000_000, i)
    torn.write_bytes(torn.read_bytes()[: torn.stat().st_size // 2])
    bench = Bench(data)
    assert until(bench.ready), "vehicle, station and page did not find each other"
    yield bench
    bench.close()


@pytest.fixture(autouse=True)
def _on_the_ground(request: pytest.FixtureRequest) -> Iterator[None]:
    yield
    if "bench" in request.fixturenames:
        bench = request.getfixturevalue("bench")
        bench.vehicle.armed, bench.vehicle.refusal = False, ""
        bench.vehicle.send_status()
        bench.free_control()
        bench.station.runs.recorder.stop()
        assert bench.station.runs.recorder.wait_idle(LIMIT)


def test_the_newest_sample_of_each_packet_is_published_as_state(bench: Bench) -> None:
    before = len(bench.inbox.got["state"])
    stamp_ns = bench.vehicle.send_telemetry()["imu"]["stamp_ns"][-1]
    assert until(lambda: any(r.source_ns == stamp_ns for r in bench.inbox.got["state"][before:]))
    stamps = [r.source_ns for r in bench.inbox.got["state"]]
    assert len(stamps) == len(set(stamps))


def test_a_problem_of_the_link_refuses_commands_and_is_an_alarm(bench: Bench) -> None:
    def told() -> bool:
        # A second process under the vehicle's name.
        beat = encode_heartbeat(1, vehicle_now(), 5, 0)
        bench.vehicle.put("vehicle_heartbeat", beat, vehicle_now())
        return (
            "two vehicles"
            in decode(
                bench.inbox.got["link_status"][-1].payload, TOPICS["link_status"].type_name
            ).problem
        )

    assert until(told)
    assert "two vehicles are called quad1" in bench.call("arm").reason
    assert bench.call("emergency", action="land").accepted
    assert bench.vehicle.requests[-1][0] == "emergency"
    status = TOPICS["station_status"].type_name
    assert until(
        lambda: (
            "two vehicles"
            in " ".join(decode(bench.inbox.got["station_status"][-1].payload, status).alarms)
        )
    )
    assert until(lambda: not bench.station.link.problem())


def test_old_telemetry_is_not_shown(bench: Bench) -> None:
    old_ns = vehicle_now() - 1_000_000_000
    bench.vehicle.send_telemetry(old_ns)
    fresh_ns = bench.vehicle.send_telemetry()["imu"]["stamp_ns"][-1]
    assert until(lambda: any(r.source_ns == fresh_ns for r in bench.inbox.got["state"]))
    assert not any(r.source_ns == old_ns for r in bench.inbox.got["state"])


def test_every_tick_is_passed_on_and_an_old_one_is_told(bench: Bench) -> None:
    old_ns = vehicle_now() - 1_000_000_000
    old = bench.vehicle.send_telemetry(old_ns)["imu"]["stamp_ns"].tolist()
    fresh = bench.vehicle.send_telemetry()["imu"]["stamp_ns"].tolist()

    def passed(ticks: list[int], source_ns: int) -> bool:
        stamps = [
            unpack(one.payload)[1]["imu"]["stamp_ns"].tolist()
            for one in list(bench.inbox.got["ticks"])
            if one.source_ns == source_ns
        ]
        return ticks in stamps

    assert until(lambda: passed(old, 0) and passed(fresh, fresh[-1]))


def test_the_link_is_good_and_the_vehicles_clock_known(bench: Bench) -> None:
    def newest_of_a_synchronised_station() -> Any:
        newest = bench.inbox.decoded("link_status")[-1]
        return newest.state == "good" and newest.round_trip > 0 and newest

    newest = until(newest_of_a_synchronised_station)
    assert newest.clock_offset == pytest.approx(AHEAD_NS * 1e-9, abs=0.1)
    assert newest.round_trip < 1
    assert newest.age < 1
    assert newest.loss < 0.5  # a busy machine may lose some


def test_heartbeats_reach_the_vehicle_in_its_own_time(bench: Bench) -> None:
    have = len(bench.vehicle.inbox.got["station_heartbeat"])
    assert until(lambda: len(bench.vehicle.inbox.got["station_heartbeat"]) > have)
    newest = bench.vehicle.inbox.got["station_heartbeat"][-1]
    stamp_ns = decode_heartbeat(newest.payload).stamp_ns
    assert abs(stamp_ns - AHEAD_NS - newest.received_ns) < 1_000_000_000


def test_a_command_reaches_the_vehicle_with_its_requester_and_id(bench: Bench) -> None:
    answer = bench.call("start_behavior", name="hover", request_id="r77", requester="grace")
    assert answer.accepted
    name, request = bench.vehicle.requests[-1]
    assert (name, request.name) == ("start_behavior", "hover")
    assert (request.request_id, request.requester) == ("r77", "grace")


@pytest.mark.parametrize(
    ("service", "fields"),
    [
        ("arm", {}),
        ("disarm", {}),
        ("start_behavior", {"name": "hover"}),
        ("change_parameters", {"parameters": to_parameters({"station.sticks.timeout": 0.3})}),
        ("record", {"start": True}),
        ("experiment", {"action": "start", "name": "hover"}),
        ("experiment", {"action": "stop"}),
    ],
)
def test_without_control_nothing_is_sent_and_the_answer_names_its_holder(
    bench: Bench, service: str, fields: dict[str, Any]
) -> None:
    assert bench.call("control", action="ask", requester="grace").accepted
    sent = len(bench.vehicle.requests)
    answer = bench.call(service, **fields)
    assert (answer.accepted, answer.reason.split(";")[0]) == (False, "grace has control")
    assert len(bench.vehicle.requests) == sent
    assert until(lambda: bench.inbox.decoded("control")[-1].holder == "grace")


@pytest.mark.parametrize("action", ["land", "cut"])
def test_an_emergency_is_everybodys_and_moves_control_to_nobody(bench: Bench, action: str) -> None:
    assert bench.call("control", action="ask", requester="grace").accepted
    assert bench.call("emergency", action=action).accepted
    name, request = bench.vehicle.requests[-1]
    assert (name, request.action, request.requester) == ("emergency", action, "ada")
    assert bench.call("arm", requester="grace").accepted


def test_quadlab_itself_may_land_whoever_has_control(bench: Bench) -> None:
    assert bench.call("control", action="ask", requester="grace").accepted
    assert bench.call("start_behavior", name="land", requester="quadlab up").accepted


def test_control_goes_from_hand_to_hand_and_everybody_hears_of_it(bench: Bench) -> None:
    assert bench.call("arm", requester="grace").accepted
    assert bench.call("control", action="ask").accepted
    assert until(lambda: bench.inbox.decoded("control")[-1].asking)
    asked = bench.inbox.decoded("control")[-1]
    assert (asked.holder, asked.asking) == ("grace", "ada")
    assert 0.0 < asked.answer_within <= 20.0
    assert bench.call("control", action="give", requester="grace").accepted
    assert until(lambda: bench.inbox.decoded("control")[-1].holder == "ada")
    assert not bench.call("disarm", requester="grace").accepted
    assert bench.call("disarm").accepted
    wrong = bench.call("control", action="steal")
    assert "; allowed are ask, give, keep, release and take" in wrong.reason


def test_sticks_of_one_without_control_do_not_reach_the_vehicle(bench: Bench) -> None:
    assert bench.call("control", action="ask", requester="grace").accepted

    def send(requester: str, forward: float, held: bool = True) -> None:
        joy = new(
            "sensor_msgs/Joy",
            header=header(time.time_ns(), requester),
            axes=[forward, 0, 0, 0],
            buttons=[held],
        )
        bench.stick.put(encode(joy), time.time_ns())

    before = len(bench.vehicle.inbox.got["joy"])
    send("ada", 0.25)
    send("grace", 0.5)

    def came() -> list[float]:
        got = bench.vehicle.inbox.got["joy"][before:]
        return [decode_joy(one.payload).axes[0] for one in got]

    assert until(lambda: 0.5 in came())
    assert 0.25 not in came()
    send("grace", 0.0, held=False)
    assert until(lambda: came()[-1] == 0.0)


def test_sticks_held_when_control_is_taken_are_let_go_by_their_own_release(bench: Bench) -> None:
    status = Inbox(bench.page, "stick_status")

    def send(requester: str, held: bool = True) -> int:
        stamp_ns = time.time_ns()
        joy = new(
            "sensor_msgs/Joy", header=header(stamp_ns, requester), axes=[0, 0, 0, 0], buttons=[held]
        )
        bench.stick.put(encode(joy), stamp_ns)
        return stamp_ns

    def at(message: Any) -> int:
        return stamp_of(message)

    def answers(requester: str) -> list[tuple[bool, str]]:
        got = status.decoded("stick_status")
        return [(one.enabled, one.reason) for one in got if one.header.frame_id == requester]

    def is_alarm() -> bool:
        lines = bench.inbox.decoded("station_status")[-1].alarms
        return any("sticks of ada dropped" in line for line in lines)

    def ada_holds() -> bool:
        """Return whether her newest order is a button that is held and counts."""
        send("ada", held=False)  # a button refused before does not count until it is released
        stamp_ns = send("ada")

        def answered() -> list[bool]:
            return [one.enabled for one in status.decoded("stick_status") if at(one) == stamp_ns]

        return until(answered) == [True]

    assert bench.call("control", action="ask").accepted
    assert until(ada_holds)
    assert bench.call("control", action="take", requester="grace").accepted
    assert until(is_alarm)
    send("ada", held=False)
    assert until(lambda: not is_alarm())
    send("grace")
    assert until(lambda: answers("grace"))
    assert answers("grace") == [(True, "")]
    send("grace", held=False)


def test_a_refusal_comes_back_with_the_vehicles_reason(bench: Bench) -> None:
    bench.vehicle.refusal = "not on the ground"
    answer = bench.call("arm")
    assert not answer.accepted
    assert answer.reason == "not on the ground"


@pytest.mark.parametrize("service", ["arm", "start_behavior", "emergency"])
def test_a_silent_vehicle_is_no_refusal_and_does_not_hold_up_the_next_command(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, service: str
) -> None:
    monkeypatch.setitem(COMMANDS, service, replace(COMMANDS[service], patience=0.5))
    bench.vehicle.answering.clear()
    fields = {"action": "land"} if service == "emergency" else {}
    with pytest.raises(NoAnswerError, match=r"^the vehicle has not answered"):
        bench.call(service, **fields)
    bench.vehicle.answering.set()
    assert bench.call(service, **fields).accepted


def test_a_late_answer_is_the_answer(bench: Bench) -> None:
    bench.vehicle.refusal = "not on the ground"
    bench.vehicle.answering.clear()
    late = threading.Timer(CALL_TIMEOUT + 0.2, bench.vehicle.answering.set)
    late.start()
    assert bench.call("arm").reason == "not on the ground"
    late.join()


def test_arming_records_a_run_with_every_sample_and_disarming_ends_it(bench: Bench) -> None:
    assert until(bench.station.parts.vehicle_parameters.defaults)
    assert bench.call("arm", requester="grace").accepted
    run_id = until(bench.recording)
    assert run_id
    stamps: list[int] = []

    def has_come(stamp_ns: int) -> bool:
        return bool(bench.inbox.got["state"][-1].source_ns >= stamp_ns)

    for _ in range(20):
        sent = bench.vehicle.send_telemetry()["imu"]["stamp_ns"].tolist()
        stamps += sent
        assert until(partial(has_come, sent[-1]))
    assert until(lambda: bench.inbox.decoded("station_status")[-1].recording)
    event_ns = vehicle_now()
    bench.vehicle.put("events", encode_event(event_ns, 20, "hello", "vehicle"), event_ns)
    assert until(lambda: any(e.msg == "hello" for e in bench.inbox.decoded("events")))
    assert bench.call("disarm", requester="grace").accepted
    assert until(lambda: not bench.recording())
    assert bench.station.runs.recorder.wait_idle(LIMIT)

    entry = bench.catalogue.get(run_id)
    assert (entry.complete, entry.recovered, entry.operator) == (True, False, "grace")
    path = bench.catalogue.resolve(run_id)
    assert entry.bytes == run_bytes(path)
    messages = list(read_log(path))
    assert entry.messages == len(messages)
    for topic in ("state", "reference", "imu", "actuators"):
        recorded = [m.publish_ns for m in messages if m.topic == f"/quad1/{topic}"]
        assert set(stamps) <= set(recorded)
    assert {"/quad1/status", "/quad1/station_status", "/quad1/link_status"} <= {
        m.topic for m in messages
    }
    assert sum(m.topic == "/quad1/events" and b"hello" in m.payload for m in messages) == 1
    attached = json.loads(read_attachments(path)["parameters.json"])
    assert attached["vehicle"] == bench.vehicle.gains
    assert attached["station"]["station.tracker.rate"] == 100.0
    defaults = json.loads(read_attachments(path)["defaults.json"])
    assert defaults.keys() == {*attached["vehicle"], *attached["station"]}
    run = read_metadata(path)["quadlab.run"]
    assert run["run_id"] == run_id
    assert run["operator"] == "grace"
    assert "git_revision" in run


def test_recording_by_hand_answers_with_the_run_and_refuses_a_second(bench: Bench) -> None:
    first = bench.call("record", start=True)
    assert first.accepted
    assert first.run_id == bench.recording()
    second = bench.call("record", start=True)
    assert not second.accepted
    assert first.run_id in second.reason
    assert until(lambda: bench.inbox.decoded("station_status")[-1].run_id == first.run_id)
    assert bench.inbox.decoded("station_status")[-1].recording
    assert bench.call("record", start=False).run_id == first.run_id
    assert not bench.call("record", start=False).accepted
    assert bench.station.runs.recorder.wait_idle(LIMIT)
    assert bench.catalogue.get(first.run_id).operator == "ada"


def test_a_repeated_record_request_has_one_effect(bench: Bench) -> None:
    first = bench.call("record", start=True, request_id="same")
    again = bench.call("record", start=True, request_id="same")
    assert again.accepted
    assert again.run_id == first.run_id


def test_station_parameters_change_here_and_are_told_to_everybody(bench: Bench) -> None:
    have = len(bench.vehicle.requests)
    answer = bench.call(
        "change_parameters", parameters=to_parameters({"station.bearings.sigma": 2.5})
    )
    assert answer.accepted
    assert from_parameters(answer.applied) == {"station.bearings.sigma": 2.5}
    assert len(bench.vehicle.requests) == have
    assert until(lambda: bench.inbox.decoded("parameter_changes"))
    change = bench.inbox.decoded("parameter_changes")[-1]
    assert (change.name, change.requester) == ("station.bearings.sigma", "ada")
    assert [from_value(v) for v in (change.old_value, change.new_value)] == [1.5, 2.5]
    assert change.instance == bench.station.link.permission.instance != 0


def test_vehicle_parameters_go_to_the_vehicle_and_both_kinds_at_once_work(bench: Bench) -> None:
    values = {"position.kp_xy": 5.0, "station.tracker.rate": 90.0}
    answer = bench.call("change_parameters", parameters=to_parameters(values))
    assert answer.accepted
    assert from_parameters(answer.applied) == values
    _, request = bench.vehicle.requests[-1]
    assert from_parameters(request.parameters) == {"position.kp_xy": 5.0}
    assert request.requester == "ada"


def test_a_change_whose_answer_is_lost_is_asked_for_again_under_its_id(bench: Bench) -> None:
    answers = bench.vehicle.lost_answers = 2
    answer = bench.call("change_parameters", parameters=to_parameters({"position.kp_xy": 4.5}))
    assert answer.accepted
    assert from_parameters(answer.applied) == {"position.kp_xy": 4.5}
    assert bench.vehicle.lost_answers == 0
    asked = [request for name, request in bench.vehicle.requests if name == "change_parameters"]
    ids = [str(request.request_id) for request in asked[-1 - answers :]]
    assert len(ids) == 3
    assert len(set(ids)) == 1


def test_a_bad_station_parameter_changes_nothing_anywhere(bench: Bench) -> None:
    have = len(bench.vehicle.requests)
    values = {"position.kp_xy": 6.0, "station.tracker.rate": 1e9}
    answer = bench.call("change_parameters", parameters=to_parameters(values))
    assert not answer.accepted
    assert "out of bounds" in answer.reason
    assert len(bench.vehicle.requests) == have
    unknown = bench.call("change_parameters", parameters=to_parameters({"station.foo": 1}))
    assert "unknown parameter" in unknown.reason


def test_the_stations_parameters_are_described_to_ros2_param(bench: Bench) -> None:
    client = ParameterClient(bench.page, "/quad1/station")
    described = {d.name: d for d in client.describe()}
    assert described["station.tracker.rate"].unit == "Hz"
    client.set({"station.tracker.drop_out": 0.0})
    with pytest.raises(ParameterError, match="out of bounds"):
        client.set({"station.tracker.drop_out": 2.0})


def test_the_truth_becomes_tracker_poses_and_bearings_at_the_vehicle(bench: Bench) -> None:
    start_ns = vehicle_now()
    poses, frames = bench.vehicle.inbox.got["tracker_pose"], bench.vehicle.inbox.got["bearings"]

    def stream() -> bool:
        """Send a stream, because a loaded machine may drop all of a burst except the first."""
        bench.send_truth((0.5, -0.5, 1.0), vehicle_now())
        return bool(poses and frames)

    assert until(stream)
    pose = decode_pose(poses[0].payload)
    np.testing.assert_allclose(pose["position_w"][0], (0.5, -0.5, 1.0), atol=0.01)
    assert int(pose["stamp_ns"][0]) >= start_ns
    assert beacon_ids_of(decode_bearings(frames[0].payload)) == [1, 2, 3, 4]


def test_sticks_reach_the_vehicle_and_silence_drops_them(bench: Bench) -> None:
    joys, have = bench.vehicle.inbox.got["joy"], len(bench.vehicle.inbox.got["joy"])
    axes = (0.5, 0.0, 0.0, -0.5)
    bench.stick.put(encode_joy(time.time_ns(), axes, True))
    assert until(lambda: len(joys) > have)
    first = decode_joy(joys[have].payload)
    assert (first.axes, first.enabled) == (axes, True)
    assert abs(first.stamp_ns - AHEAD_NS - joys[have].received_ns) < 1_000_000_000
    assert until(lambda: not decode_joy(joys[-1].payload).enabled)

    def is_alarm() -> bool:
        alarms = bench.inbox.decoded("station_status")[-1].alarms
        return any("dead-man" in alarm for alarm in alarms)

    assert until(is_alarm)
    bench.stick.put(encode_joy(time.time_ns(), axes, False))
    assert until(lambda: not is_alarm())


def test_sticks_of_a_page_that_stood_still_are_ignored(bench: Bench) -> None:
    have = len(bench.vehicle.inbox.got["joy"])
    old_ns = time.time_ns() - 2_000_000_000
    bench.stick.put(encode_joy(old_ns, (1, 0, 0, 0), True), old_ns)
    bench.stick.put(encode_joy(time.time_ns(), (0, 0, 0, 0), False))
    assert until(lambda: len(bench.vehicle.inbox.got["joy"]) > have)
    later = bench.vehicle.inbox.got["joy"][have:]
    assert not any(decode_joy(r.payload).enabled for r in later)


def test_a_torn_run_was_recovered_at_the_start(bench: Bench) -> None:
    def recovered() -> bool:
        entries = {e.id: e for e in bench.catalogue.runs()}
        return "torn" in entries and entries["torn"].recovered

    assert until(recovered)
    assert is_closed(bench.data / "runs" / "torn.mcap")


def test_the_station_does_not_wait_for_a_compiler() -> None:
    """numba, scipy and OpenCV cost seconds at the start, and nothing here needs them."""
    code = "import console.station, sys; print({'numba', 'scipy', 'cv2'} & set(sys.modules))"
    found = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert found.stdout.strip() == "set()"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_closes_the_run_and_exits_with_zero(
    tmp_path: Path, number: signal.Signals
) -> None:
    vehicle, loopback = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_STREAM)
    words = ["--data", str(tmp_path), "--vehicle", f"quad1=127.0.0.1:{vehicle}"]
    words += ["--loopback-port", str(loopback)]
    child = subprocess.Popen(
        [sys.executable, "-m", "quadlab", "station", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    try:
        assert child.stdout is not None
        assert "serves" in child.stdout.readline()
        session = loopback_session(loopback)
        page = Node(session, "/quad1", "page")
        client = page.client("station/record", SERVICES["record"])
        request = new(f"{SERVICES['record']}_Request", request_id="1", requester="ada", start=True)
        answer = until(lambda: _try(client, request))
        assert answer.accepted, answer.reason
        arm = page.client("station/arm", SERVICES["arm"])
        refused = arm.call(new(f"{SERVICES['arm']}_Request", request_id="2"), timeout=5.0)
        assert "link to the vehicle is lost" in refused.reason
        page.close()
        session.close()
        child.send_signal(number)
        _, errors = child.communicate(timeout=LIMIT)
        assert child.returncode == 0, errors
        assert "Traceback" not in errors
    finally:
        child.kill()
        child.communicate()
    path = tmp_path / "runs" / answer.run_id
    assert is_closed(path)
    entry = Catalogue(tmp_path).get(answer.run_id)
    assert (entry.complete, entry.problem) == (True, "")
    assert json.loads(read_attachments(path)["parameters.json"])["vehicle"] is None


def _try(client: Any, request: Any) -> Any:
    try:
        return client.call(request, timeout=1.0)
    except LinkError:
        return None
