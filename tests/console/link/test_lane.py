"""Telemetry by the lane and back over Zenoh, between a vehicle's and a station's own sessions."""

from __future__ import annotations

import itertools
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from console.link.lane import VehicleLane
from console.link.monitor import LinkMonitor
from tests.support.station import StationLink
from tests.waiting import free_port
from vehicle.comms.lane import CommsLane
from vehicle.comms.publish import LinkRadio
from vehicle_link.security.authority import ensure_certificates
from vehicle_link.topics.control_inputs import encode_heartbeat
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import OtherPath, Received
from vehicle_link.transport.session import vehicle_session

WAIT = 15.0  # s: a bound, not an expectation


class Ends:
    """A vehicle's radio and lane, a station's, and a node of a third party on the base."""

    def __init__(self, folder: Path, publish_one_in: int = 1) -> None:
        files = ensure_certificates(folder)
        udp = free_port(socket.SOCK_DGRAM)
        self._link = StationLink(udp, files)
        self._sessions = [
            vehicle_session(udp, files, "127.0.0.1"),
            loopback_session(self._link.loopback_port),
        ]
        assert self._link.wait(WAIT)
        at_vehicle, at_station, base = (
            Node(s, "/quad1", n)
            for s, n in (
                (self._sessions[0], "vehicle"),
                (self._link.session, "station"),
                (self._sessions[1], "mocap"),
            )
        )
        self._nodes = [base, at_station, at_vehicle]
        self.at_vehicle: dict[str, list[Received]] = {}
        self.vehicle = CommsLane(at_vehicle, 0)
        self.radio = LinkRadio(at_vehicle, self.vehicle.paths(publish_one_in))
        for name in ("tracker_pose", "joy", "station_heartbeat"):
            self.vehicle.subscribe(name, self.at_vehicle.setdefault(name, []).append)
        self.vehicle.start()
        self.link = LinkMonitor()
        self.telemetry: list[Received] = []
        self.station = VehicleLane(
            at_station, "127.0.0.1", self.link, self.telemetry.append, lambda received: None
        )
        self.heartbeats = at_station.advertise(
            TOPICS["station_heartbeat"], OtherPath(self.station.send_heartbeat, publish_one_in)
        )
        self.over_zenoh: list[int] = []
        for name in ("vehicle_heartbeat", "station_heartbeat"):
            base.subscribe(
                name, TOPICS[name].type_name, lambda r: self.over_zenoh.append(r.sequence)
            )
        self.poses = base.advertise(TOPICS["tracker_pose"])
        self.own_poses = at_station.advertise(TOPICS["tracker_pose"])
        self.zenoh = self.radio.publishers["telemetry"]
        self.sent = 0

    def send(self) -> bytes:
        """Send a heartbeat and a packet; return the packet's content."""
        self.sent += 1
        now_ns = time.time_ns()
        self.radio.put("vehicle_heartbeat", encode_heartbeat(self.sent, now_ns, 7), now_ns)
        self.radio.put("telemetry", b"packet %d" % self.sent, now_ns)
        return b"packet %d" % self.sent

    def send_until(self, reached: Callable[[], Any]) -> None:
        tick, end = threading.Event(), time.monotonic() + WAIT
        while not reached():
            assert time.monotonic() < end
            self.send()
            tick.wait(0.02)

    def by_the_lane_alone(self) -> bool:
        return self.link.path == "datagram" and not self.zenoh.has_subscribers

    def heartbeats_by_lane(self) -> list[int]:
        """Return the list that collects the numbers of the station's heartbeats by the lane.

        Those that arrived earlier over Zenoh are left out, as on the vehicle.
        """
        came: list[int] = []
        lane = self.vehicle._lane
        deliver = lane._deliver

        def record(topic: str, received: Received) -> None:
            if topic == "station_heartbeat":
                came.append(received.sequence)
            deliver(topic, received)

        lane._deliver = record
        return came

    def block(self, is_blocked: bool) -> None:
        """Block all datagrams, as a firewall would, or let them through again."""
        lane = self.vehicle._lane._socket
        if is_blocked:
            lane.send = lambda datagram, address: True  # type: ignore[method-assign]
        else:
            del lane.send

    def close(self) -> None:
        self.station.close()
        self.vehicle.close()
        self.radio.close()
        for node in self._nodes:
            node.close()
        for session in (self._sessions[1], self._link, self._sessions[0]):
            session.close()


@pytest.fixture(scope="module")
def ends(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ends]:
    made = Ends(tmp_path_factory.mktemp("tls"))
    yield made
    made.close()


def test_telemetry_comes_by_datagrams_and_no_longer_over_zenoh(ends: Ends) -> None:
    ends.send_until(ends.by_the_lane_alone)
    newest = ends.send()
    ends.send_until(lambda: newest in [received.payload for received in ends.telemetry])
    assert ends.link.session_silence() < WAIT  # heartbeats also arrive over Zenoh


def test_without_datagrams_it_comes_over_zenoh_and_with_them_back_again(ends: Ends) -> None:
    ends.send_until(ends.by_the_lane_alone)
    ends.block(True)
    ends.send_until(lambda: ends.link.path == "quic")
    ends.block(False)
    ends.send_until(ends.by_the_lane_alone)


def test_nothing_is_handed_on_twice_whatever_the_way(ends: Ends) -> None:
    """Earlier tests make messages alternate between lane and link, too."""
    ends.send_until(ends.by_the_lane_alone)
    payloads = [received.payload for received in ends.telemetry]
    assert len(set(payloads)) == len(payloads)


@pytest.mark.parametrize("whose", ["own_poses", "poses"])
def test_poses_of_station_and_ros_nodes_reach_the_vehicle_once(ends: Ends, whose: str) -> None:
    ends.send_until(ends.by_the_lane_alone)
    came, newest = ends.at_vehicle["tracker_pose"], ends.vehicle._newest
    before, publisher = newest.late, getattr(ends, whose)
    sent: list[bytes] = []

    def came_by_both() -> bool:
        sent.append(b"%s %d" % (whose.encode(), len(sent)))
        publisher.put(sent[-1])
        # A copy of an earlier test's pose may count as late as well.
        return newest.late > before and any(one.payload in sent for one in list(came))

    ends.send_until(came_by_both)
    payloads = [received.payload for received in list(came)]
    assert len(set(payloads)) == len(payloads)
    assert set(payloads) & set(sent)


def test_poses_come_over_zenoh_only_while_the_station_is_not_heard_by_the_lane(ends: Ends) -> None:
    lane, came = ends.vehicle, ends.at_vehicle["tracker_pose"]

    numbers = itertools.count()

    def is_by_the_lane_alone() -> bool:
        lane.note_received()
        return lane._over_zenoh is None and ends.by_the_lane_alone()

    def one_comes() -> bool:
        ends.own_poses.put(b"alone %d" % next(numbers))
        return any(received.payload.startswith(b"alone") for received in list(came))

    ends.send_until(lambda: is_by_the_lane_alone() and one_comes())
    station = ends.station._lane
    assert station is not None
    station.send = lambda *_, **__: False  # type: ignore[method-assign]
    try:
        ends.send_until(lambda: lane._over_zenoh is not None)
        came.clear()
        ends.send_until(one_comes)
    finally:
        del station.send


def test_a_vehicles_other_process_is_asked_for_keys_by_the_station(ends: Ends) -> None:
    ends.send_until(ends.by_the_lane_alone)
    before = set(ends.vehicle._lane._lanes)
    ends.vehicle._lane._lanes = {}  # it has no keys, as after a start
    ends.send_until(lambda: ends.vehicle._lane._lanes and ends.by_the_lane_alone())
    assert len(ends.vehicle._lane._lanes) == 1
    assert before.isdisjoint(ends.vehicle._lane._lanes)


def test_of_heartbeats_that_go_by_the_lane_one_in_so_many_goes_over_zenoh_too(
    tmp_path: Path,
) -> None:
    """Without the lane all are sent over Zenoh."""
    ends = Ends(tmp_path, publish_one_in=4)
    ends.send_until(ends.by_the_lane_alone)
    by_lane = ends.heartbeats_by_lane()
    try:
        before = len(ends.over_zenoh)

        def enough() -> bool:
            ends.heartbeats.put(encode_heartbeat(1, time.time_ns(), 8))
            return len(ends.over_zenoh) >= before + 10

        ends.send_until(enough)
        seldom = ends.over_zenoh[before:]
        assert all(sequence % 4 == 0 for sequence in seldom), seldom
        ends.send_until(lambda: len(by_lane) >= 15)
        came = list(by_lane)
        assert came == list(range(came[0], came[0] + len(came))), "all of them by the lane"
        ends.vehicle._lane._lanes = {}  # there is none
        before = len(ends.over_zenoh)
        ends.radio.put("vehicle_heartbeat", encode_heartbeat(1, time.time_ns(), 7), time.time_ns())
        ends.radio.put("vehicle_heartbeat", encode_heartbeat(2, time.time_ns(), 7), time.time_ns())
        ends.send_until(lambda: len(ends.over_zenoh) >= before + 2)
        one, other = ends.over_zenoh[before : before + 2]
        assert other == one + 1
    finally:
        ends.close()
