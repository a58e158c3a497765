"""Two stations on one vehicle, each with its hub and radio.

The sessions, the vehicle's inbox and the stations' outboxes are real.
"""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bearing_sim import PoseMeasurement
from console.link.monitor import LinkMonitor
from console.link.outbox import Outbox
from tests.waiting import free_port, wait_for
from vehicle.comms.inbound import Inbound
from vehicle.comms.vehicle_clock import VehicleClock
from vehicle_link.process_instance import new_instance, short_id
from vehicle_link.security.authority import TlsFiles, ensure_certificates
from vehicle_link.topics.control_inputs import encode_heartbeat
from vehicle_link.topics.measurements import decode_pose
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received
from vehicle_link.transport.radio import Radio
from vehicle_link.transport.session import hub_session, vehicle_session

WAIT = 10.0  # s: a bound, not an expectation
BEAT = 0.02


class _Beating:
    """Thread that calls `beat` until it is closed."""

    def __init__(self, session: Any, node: str) -> None:
        self.session, self.node = session, Node(session, "/quad1", node)
        self.closing = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def subscribe(self, name: str, callback: Callable[[Received], None]) -> None:
        self.node.subscribe(name, TOPICS[name].type_name, callback, qos=TOPICS[name].qos)

    def _run(self) -> None:
        count = 0
        while not self.closing.wait(BEAT):
            count += 1
            self.beat(count)

    def beat(self, count: int) -> None: ...

    def close(self) -> None:
        self.closing.set()
        self._thread.join()
        self.session.close()


class Vehicle(_Beating):
    def __init__(self, port: int, tls: TlsFiles) -> None:
        super().__init__(vehicle_session(port, tls, "127.0.0.1"), "vehicle")
        self.holders: list[int] = []
        self.poses: list[float] = []  # x of each
        self.said: list[str] = []
        self.instance = new_instance()
        clock = VehicleClock()
        self.inbound = Inbound(
            None,  # type: ignore[arg-type]
            clock,
            lambda level, text: self.said.append(text),
            print,
            self._taken,
        )
        for name in ("station_heartbeat", "tracker_pose"):
            self.subscribe(name, partial(self._heard, name))
        self._out = self.node.advertise(TOPICS["vehicle_heartbeat"])
        self._thread.start()

    def _heard(self, name: str, received: Received) -> None:
        self.inbound.handle(name, received.payload, received.gid)

    def _taken(self, topic: str, payload: bytes, stamp_ns: int) -> None:
        self.poses.append(float(decode_pose(payload)["position_w"][0, 0]))

    def beat(self, count: int) -> None:
        holder = self.inbound.holder
        if not self.holders or self.holders[-1] != holder:
            self.holders.append(holder)
        self._out.put(encode_heartbeat(count, time.time_ns(), self.instance, holder))


class Station(_Beating):
    """Station that sends heartbeats and poses, if allowed; `number` is the x of its poses."""

    def __init__(self, port: int, tls: TlsFiles, number: int) -> None:
        loopback = free_port(socket.SOCK_STREAM)
        super().__init__(hub_session(loopback), "station")
        self.link = LinkMonitor("quad1", new_instance())
        self.instance, self.number = self.link.permission.instance, number
        self.outbox = Outbox(
            self.node, "quad1", lambda *row: None, time.time_ns, self.link.permission
        )
        self.subscribe("vehicle_heartbeat", lambda got: self.link.beat(got.payload))
        self._place = f"127.0.0.1:{port}", tls, loopback
        self.radio = self.dial()
        self._thread.start()

    def dial(self, endpoint: str = "") -> Radio:
        own, tls, loopback = self._place
        return Radio(endpoint or own, tls, loopback, lambda: 0.0)

    def beat(self, count: int) -> None:
        if self.link.permission.sends_heartbeats:
            self.outbox.heartbeat(count)
        place = np.array([float(self.number), 0.0, 0.0])
        self.outbox.pose(PoseMeasurement(time.time_ns(), place, np.array([1.0, 0.0, 0.0, 0.0])))

    def close(self) -> None:
        self.radio.close(WAIT)
        super().close()


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Callable[[int], Any]]:
    """Yield `make`: `make(0)` is the vehicle, which is first; other numbers are stations."""
    tls, port = ensure_certificates(tmp_path), free_port(socket.SOCK_DGRAM)
    made: list[_Beating] = []

    def one(number: int) -> Any:
        made.append(Station(port, tls, number) if number else Vehicle(port, tls))
        return made[-1]

    yield one
    for each in reversed(made):
        if not each.closing.is_set():
            each.close()


def test_a_second_station_waits_until_the_first_is_gone(make: Callable[[int], Any]) -> None:
    vehicle, first = make(0), make(1)
    wait_for(lambda: vehicle.poses)
    second = make(2)
    wait_for(lambda: second.link.problem())
    assert second.link.problem() == f"another station ({short_id(first.instance)}) flies quad1"
    assert second.link.refusal("arm").startswith("another station")
    assert second.link.refusal("emergency") == ""
    assert first.link.problem() == ""
    have = len(vehicle.poses)
    wait_for(lambda: len(vehicle.poses) > have + 20)
    assert set(vehicle.poses) == {1.0}  # never a pose of the other
    assert vehicle.inbound.holder == first.instance
    first.close()
    wait_for(lambda: vehicle.poses[-1] == 2.0)
    assert second.link.refusal("arm") == ""
    assert vehicle.inbound.holder == second.instance


def test_of_two_stations_that_start_together_one_stays(make: Callable[[int], Any]) -> None:
    stations = [make(1), make(2)]
    vehicle = make(0)
    wait_for(lambda: len(vehicle.poses) > 50 and any(s.link.problem() for s in stations))
    assert [holder for holder in vehicle.holders if holder] == [vehicle.inbound.holder]
    assert len(set(vehicle.poses)) == 1


def test_two_vehicles_of_one_name_are_noticed(make: Callable[[int], Any], tmp_path: Path) -> None:
    vehicle, station = make(0), make(1)
    wait_for(lambda: vehicle.poses)
    port = free_port(socket.SOCK_DGRAM)
    twin = Vehicle(port, ensure_certificates(tmp_path))
    second = station.dial(f"127.0.0.1:{port}")
    try:
        wait_for(lambda: station.link.problem().startswith("two vehicles are called quad1"))
        for one in (vehicle, twin):
            assert short_id(one.instance) in station.link.problem()
        assert station.link.refusal("arm")
    finally:
        second.close(WAIT)
        twin.close()


def test_the_first_that_comes_back_finds_the_second_flying(make: Callable[[int], Any]) -> None:
    vehicle, first = make(0), make(1)
    wait_for(lambda: vehicle.inbound.holder == first.instance)
    second = make(2)
    wait_for(lambda: second.link.problem())
    first.radio.close(WAIT)  # its process continues
    wait_for(lambda: vehicle.inbound.holder == second.instance)
    first.radio = first.dial()
    wait_for(lambda: first.link.problem())
    assert short_id(second.instance) in first.link.problem()
