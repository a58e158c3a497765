"""Several vehicles under one station, each with a radio and a base station: nothing mixes."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest

from console.base_station import BaseStation
from console.catalogue.catalogue import Catalogue
from console.station_parts import StationOptions
from flight_log import is_closed, summarize
from quadrotor.records import TICK
from tests.waiting import free_port, until
from vehicle_link.messages import decode, encode, new
from vehicle_link.process_instance import new_instance
from vehicle_link.security.authority import TlsFiles, ensure_certificates
from vehicle_link.telemetry import pack
from vehicle_link.topics.control_inputs import encode_heartbeat
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport.heartbeat import LinkState
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.radio import Radio
from vehicle_link.transport.session import hub_session, vehicle_session
from vehicle_link.transport.time_sync import serve_time_sync

NAMES = ("quad1", "quad2")


class FakeVehicle:
    """Fake vehicle that sends heartbeats, flies where it is commanded, and answers commands."""

    def __init__(self, name: str, files: TlsFiles, x: float) -> None:
        self.port = free_port(socket.SOCK_DGRAM)
        self.requests: list[str] = []
        self.armed = False
        self._x = x
        self._session = vehicle_session(self.port, files, "127.0.0.1")
        self._node = Node(self._session, f"/{name}", "vehicle")
        sent = ("vehicle_heartbeat", "status", "telemetry")
        self._out = {topic: self._node.advertise(TOPICS[topic]) for topic in sent}
        for service in ("arm", "disarm"):
            self._node.serve(service, SERVICES[service], partial(self._answer, service))
        serve_time_sync(self._node, time.time_ns)
        self._instance, self._closing = new_instance(), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._thread.join(5)
        self._node.close()
        threading.Thread(target=self._session.close, daemon=True).start()

    def _answer(self, service: str, _: Any) -> Any:
        self.requests.append(service)
        self.armed = service == "arm"
        return new(f"{SERVICES[service]}_Response", accepted=True)

    def _run(self) -> None:
        count = 0
        while not self._closing.wait(0.05):
            count += 1
            now_ns = time.time_ns()
            beat = encode_heartbeat(count, now_ns, self._instance)
            self._out["vehicle_heartbeat"].put(beat, now_ns)
            status = new("quadlab_msgs/VehicleStatus", armed=self.armed)
            self._out["status"].put(encode(status), now_ns)
            ticks = np.zeros(1, TICK)
            ticks["imu"]["stamp_ns"] = now_ns
            ticks["state"]["quaternion_wb"][:, 0] = 1
            ticks["state"]["position_w"][:, 0] = self._x
            self._out["telemetry"].put(pack(ticks, count), now_ns)


class Laboratory:
    """Two vehicles, their stations in one process, and a client."""

    def __init__(self, data: Path) -> None:
        files, loopback = ensure_certificates(data / "certificates"), free_port(socket.SOCK_STREAM)
        self.vehicles = {name: FakeVehicle(name, files, 1.0 + k) for k, name in enumerate(NAMES)}
        self.catalogue = Catalogue(data)
        self._hub, instance = hub_session(loopback), new_instance()
        settings = {
            "station.recorder.after_disarm": 0.0,
            "station.recorder.keep_free": 10.0,
            "station.preflight.blocks": False,
        }
        self.stations = {
            name: BaseStation(
                self._hub,
                self.catalogue,
                StationOptions(
                    name,
                    settings=settings,
                    housekeeping=name == NAMES[0],
                    vehicles=2,
                    instance=instance,
                ),
            )
            for name in NAMES
        }
        self.radios = {
            name: Radio(
                f"127.0.0.1:{self.vehicles[name].port}",
                files,
                loopback,
                station.link.session_silence,
            )
            for name, station in self.stations.items()
        }
        self._session = loopback_session(loopback)
        self.pages = {name: Node(self._session, f"/{name}", "page") for name in NAMES}
        self.heard: dict[str, list[Any]] = {name: [] for name in NAMES}
        for name, page in self.pages.items():
            state = TOPICS["state"]
            page.subscribe("state", state.type_name, self._hear(name))

    def _hear(self, name: str) -> Callable[[Any], None]:
        kind = TOPICS["state"].type_name
        return lambda received: self.heard[name].append(decode(received.payload, kind))

    def is_linked(self, name: str) -> bool:
        link = self.stations[name].link
        return link.state() is LinkState.GOOD and link.clock_known

    def call(self, name: str, service: str, requester: str, **fields: Any) -> Any:
        request = new(
            f"{SERVICES[service]}_Request",
            request_id=f"r{time.monotonic_ns()}",
            requester=requester,
            **fields,
        )
        client = self.pages[name].client(f"station/{service}", SERVICES[service])
        return client.call(request, timeout=5.0)

    def close(self) -> None:
        for page in self.pages.values():
            page.close()
        self._session.close()
        for radio in self.radios.values():
            radio.close()
        for station in self.stations.values():
            station.close()
        for vehicle in self.vehicles.values():
            vehicle.close()
        self.catalogue.close()
        threading.Thread(target=self._hub.close, daemon=True).start()


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Laboratory]:
    made = Laboratory(tmp_path_factory.mktemp("fleet"))
    assert until(lambda: all(map(made.is_linked, NAMES)))
    yield made
    made.close()


def test_each_vehicle_s_state_comes_under_its_own_name(laboratory: Laboratory) -> None:
    assert until(lambda: all(laboratory.heard.values()))
    found = {
        name: {one.pose.pose.position.x for one in list(heard)}
        for name, heard in laboratory.heard.items()
    }
    assert found == {"quad1": {1.0}, "quad2": {2.0}}


def test_commands_control_and_runs_are_each_vehicle_s_own(laboratory: Laboratory) -> None:
    one, two = (laboratory.vehicles[name] for name in NAMES)
    assert laboratory.call("quad1", "arm", "ada").accepted
    assert laboratory.call("quad2", "arm", "bob").accepted
    assert (one.requests, two.requests) == (["arm"], ["arm"])
    refused = laboratory.call("quad2", "disarm", "ada")
    assert not refused.accepted
    assert "bob" in refused.reason
    assert two.requests == ["arm"]
    runs = {name: station.runs.recorder for name, station in laboratory.stations.items()}
    assert until(lambda: all(one.run_id for one in runs.values()))
    ids = {name: one.run_id for name, one in runs.items()}
    heard = {name: len(states) for name, states in laboratory.heard.items()}
    assert until(lambda: all(len(laboratory.heard[name]) > heard[name] + 1 for name in NAMES))
    assert laboratory.call("quad1", "disarm", "ada").accepted
    assert until(lambda: not runs["quad1"].run_id)
    assert runs["quad2"].run_id == ids["quad2"], "the other one's recording went on"
    assert laboratory.call("quad2", "disarm", "bob").accepted
    assert until(lambda: not runs["quad2"].run_id)
    for name, operator in zip(NAMES, ("ada", "bob"), strict=True):
        (run,) = laboratory.catalogue.runs(vehicle=name)
        assert (run.id, run.operator) == (ids[name], operator)
        path = laboratory.catalogue.resolve(run.id)
        assert until(partial(is_closed, path))
        written = {topic.split("/")[1] for topic in summarize(path).topics}
        assert written == {name, "tf", "tf_static"}


def test_a_vehicle_that_goes_leaves_the_other_linked(laboratory: Laboratory) -> None:
    laboratory.vehicles["quad2"].close()
    assert until(lambda: not laboratory.is_linked("quad2"))
    assert until(lambda: laboratory.is_linked("quad1"))
    assert laboratory.call("quad1", "arm", "ada").accepted


def test_of_many_each_beats_half_as_often_and_every_other_time_over_the_link(
    tmp_path: Path,
) -> None:
    session, catalogue = hub_session(free_port(socket.SOCK_STREAM)), Catalogue(tmp_path)
    heard: dict[int, list[int]] = {3: [], 4: []}

    def listen(count: int, beats: list[int]) -> None:
        name = f"of{count}"
        listener = Node(session, f"/{name}", "listener")
        topic = TOPICS["station_heartbeat"]
        listener.subscribe(
            topic.name, topic.type_name, lambda received: beats.append(received.sequence)
        )
        station = BaseStation(
            session, catalogue, StationOptions(name, vehicles=count, housekeeping=False)
        )
        works = mock.patch.object(station.parts.subscriptions, "send_heartbeat", return_value=True)
        try:
            with works:  # as by a lane that is up
                enough = len(beats) + 12
                until(lambda: len(beats) >= enough)
        finally:
            station.close()
            listener.close()

    try:
        for count, beats in heard.items():
            listen(count, beats)
    finally:
        catalogue.close()
        session.close()
    assert np.diff(heard[3][-10:]).tolist() == [1] * 9
    assert np.diff(heard[4][-10:]).tolist() == [2] * 9
