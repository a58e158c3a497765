"""`quadlab tracker` as a separate process, between a system's bytes and the vehicle."""

from __future__ import annotations

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.trackers.process import GAP, OTHERS, STATUS_PERIOD
from extensions.mocap.ros2 import Ros2Source
from quadrotor.errors import MeasurementError
from quadrotor.records import beacon_ids_of, pose_sample
from tests.support.station import LinkedStation
from tests.support.subscribers import has_subscriber
from tests.waiting import free_port, wait_for
from vehicle_link.messages import decode, encode, header, new
from vehicle_link.topics.control_inputs import encode_heartbeat
from vehicle_link.topics.measurements import (
    decode_bearings,
    decode_pose,
    decode_position,
    pose_messages,
)
from vehicle_link.topics.table import TOPICS, Topic
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received
from vehicle_link.transport.time_sync import serve_time_sync

AHEAD_NS = 40_000_000_000
"""Time, ns, by which the vehicle's clock is ahead of the station's."""
PERIOD = 0.01
PLACE = (0.5, -0.5, 1.0)


class Laboratory:
    """System that sends lines over UDP at 100 Hz, with the stamps of its own clock."""

    def __init__(self, port: int) -> None:
        self.lines = ["{stamp},cf7,0.5,-0.5,1.0,1,0,0,0"]
        self.ahead = 5000.0  # s, of its clock
        self._port, self._stop, self._turn = port, threading.Event(), threading.Lock()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def change(self, lines: list[str]) -> None:
        """Send a frame of the present lines, and one of these, taken 1 ms later.

        A busy machine may pause the thread for so long that a flip would be a plausible turn.
        """
        with self._turn:
            stamp = time.time() + self.ahead
            self._send(stamp)
            self.lines = lines
            self._send(stamp + 0.001)

    def close(self) -> None:
        self._stop.set()
        self._thread.join(5)
        self._socket.close()

    def _run(self) -> None:
        while not self._stop.wait(PERIOD):
            with self._turn:
                self._send(time.time() + self.ahead)

    def _send(self, stamp: float) -> None:
        text = "\n".join(self.lines).format(stamp=f"{stamp:.6f}")
        if text:
            self._socket.sendto(text.encode(), ("127.0.0.1", self._port))


class Bench(LinkedStation):
    """Station that follows a tracker process, a vehicle that receives, and that process."""

    def __init__(self, data: Path) -> None:
        super().__init__(data, {}, follows_process=True)
        self.poses: list[Received] = []
        self.frames: list[Received] = []
        self.events: list[str] = []
        self.statuses: list[Any] = []
        serve_time_sync(self.at_vehicle, lambda: time.time_ns() + AHEAD_NS)
        self.places: list[Received] = []
        for name, came in (
            ("tracker_pose", self.poses),
            ("tracker_position", self.places),
            ("bearings", self.frames),
        ):
            self.at_vehicle.subscribe(name, TOPICS[name].type_name, came.append)
        self.page.subscribe("events", TOPICS["events"].type_name, self._event)
        self.page.subscribe("tracker_status", TOPICS["tracker_status"].type_name, self._status)
        self.children: list[subprocess.Popen[bytes]] = []
        self._closing = threading.Event()
        self._beating = threading.Thread(target=self._beat, daemon=True)
        self._beating.start()
        wait_for(lambda: self.station.link.clock_known)

    def track(self, *words: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "quadlab", "tracker", *words]
        self.children.append(subprocess.Popen([*command, "--loopback-port", str(self.loopback)]))
        return self.children[-1]

    def told(self, words: str) -> bool:
        return any(words in event for event in self.events)

    def close(self) -> None:
        self._closing.set()
        self._beating.join(5)
        for child in self.children:
            child.terminate()
        for child in self.children:
            child.wait(20)
        super().close()

    def _beat(self) -> None:
        beats = self.at_vehicle.advertise(TOPICS["vehicle_heartbeat"])
        while not self._closing.wait(0.05):
            now_ns = time.time_ns() + AHEAD_NS
            beats.put(encode_heartbeat(1, now_ns), now_ns)

    def _event(self, received: Received) -> None:
        self.events.append(str(decode(received.payload, TOPICS["events"].type_name).msg))

    def _status(self, received: Received) -> None:
        self.statuses.append(decode(received.payload, TOPICS["tracker_status"].type_name))


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    bench = Bench(tmp_path_factory.mktemp("data"))
    yield bench
    bench.close()


@pytest.fixture(scope="module")
def laboratory(bench: Bench) -> Iterator[Laboratory]:
    port = free_port(socket.SOCK_DGRAM)
    laboratory = Laboratory(port)
    bench.track("udp", "--host", "127.0.0.1", "--port", str(port), "--body", "quad1=cf7")
    wait_for(lambda: bench.poses)
    yield laboratory
    laboratory.close()


def test_lines_over_udp_become_poses_and_bearings_on_the_vehicles_clock(
    bench: Bench, laboratory: Laboratory
) -> None:
    wait_for(lambda: len(bench.poses) > 50 and len(bench.frames) > 5)
    newest = bench.poses[-1]
    pose = decode_pose(newest.payload)[0]
    np.testing.assert_allclose(pose["position_w"], PLACE)
    age = 1e-9 * (newest.received_ns + AHEAD_NS - int(pose["stamp_ns"]))
    assert -0.005 < age < 1.0  # right by the jitter; a busy machine may deliver late
    assert beacon_ids_of(decode_bearings(bench.frames[-1].payload)) == [1, 2, 3, 4]
    wait_for(lambda: bench.statuses[-1].frame_rate > 10)
    status = bench.statuses[-1]
    assert (list(status.seen), status.body, status.problem) == (["cf7"], "cf7", "")
    assert sum(status.latency_counts) > 0


def test_the_simulated_tracker_is_off_beside_a_tracker_process(
    bench: Bench, laboratory: Laboratory
) -> None:
    truth = bench.page.advertise(TOPICS["truth"])
    for _ in range(20):
        stamp_ns = time.time_ns() + AHEAD_NS
        odometry = new("nav_msgs/Odometry", header=header(stamp_ns, "world"))
        odometry.pose.pose.orientation.w = 1.0
        odometry.pose.pose.position.x = 9.0
        truth.put(encode(odometry), stamp_ns)
    after = len(bench.poses)
    wait_for(lambda: len(bench.poses) > after + 10)
    xs = {float(decode_pose(one.payload)["position_w"][0, 0]) for one in list(bench.poses)}
    assert xs == {0.5}


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        (["{stamp},cf8,0.5,-0.5,1.0,1,0,0,0"], "no body 'cf7' is seen; udp"),
        (["{stamp},cf7,0.5,-0.5,1.0,1,0,0,0"] * 2, "two bodies are called 'cf7'"),
        (["{stamp},cf7,500,-500,1000,1,0,0,0"], "--unit mm"),
        (["{stamp},cf7,0.5,-0.5,1.0,0.7071,0,0,0.7071"], "flipped by 90°"),
        (["{stamp},cf7,0.5,-0.5,-1.0,1,0,0,0"], "--up y"),
    ],
)
def test_poses_that_must_not_be_flown_on_are_kept_from_the_vehicle_and_told(
    bench: Bench, laboratory: Laboratory, lines: list[str], told: str
) -> None:
    good = laboratory.lines
    bench.events.clear()
    try:
        laboratory.change(lines)
        wait_for(lambda: bench.told(told))
        kept, received = len(bench.poses), len(bench.statuses)
        wait_for(lambda: len(bench.statuses) > received + 5)
        assert len(bench.poses) <= kept + 1  # the last good one may be in transit
    finally:
        laboratory.change(good)
    wait_for(lambda: len(bench.poses) > kept + 5 and not bench.statuses[-1].problem)


def test_a_single_marker_is_sent_as_positions(bench: Bench, laboratory: Laboratory) -> None:
    good, laboratory.lines = laboratory.lines, ["{stamp},cf7,0.5,-0.5,1.0"]
    wait_for(lambda: len(bench.places) > 5)
    place = decode_position(bench.places[-1].payload)[0]
    np.testing.assert_allclose(place["position_w"], PLACE)
    laboratory.lines, before = good, len(bench.poses)
    wait_for(lambda: len(bench.poses) > before + 5)


def test_a_clock_that_is_set_by_a_second_is_told_and_followed(
    bench: Bench, laboratory: Laboratory
) -> None:
    laboratory.ahead += 1.0
    wait_for(lambda: bench.told("was set by +"))
    before = len(bench.poses)
    wait_for(lambda: len(bench.poses) > before + 10)
    newest = bench.poses[-1]
    stamp_ns = int(decode_pose(newest.payload)["stamp_ns"][0])
    assert abs(newest.received_ns + AHEAD_NS - stamp_ns) < 500_000_000
    assert bench.statuses[-1].clock_jumps == 1


def test_bodies_that_are_numbered_anew_in_each_frame_crowd_out_none(
    bench: Bench, laboratory: Laboratory
) -> None:
    wait_for(lambda: list(bench.statuses[-1].seen) == ["cf7"])
    numbers = iter(range(1_000_000))
    begun = len(bench.statuses)
    for _ in range(20):
        before = len(bench.poses)
        laboratory.change(
            [laboratory.lines[0], *(f"{{stamp}},{next(numbers)},1,1,1" for _ in range(1000))][::-1]
        )
        laboratory.lines = laboratory.lines[-1:]
        wait_for(lambda before=before: len(bench.poses) > before)  # type: ignore[misc]
    wait_for(lambda: len(bench.statuses[-1].seen) == OTHERS)
    assert all(len(status.seen) <= OTHERS for status in bench.statuses[begun:])
    wait_for(lambda: list(bench.statuses[-1].seen) == ["cf7"])


def test_a_line_that_is_none_is_told_and_the_next_frame_taken(
    bench: Bench, laboratory: Laboratory
) -> None:
    good = laboratory.lines
    laboratory.lines = ["hello, mocap"]
    wait_for(lambda: bench.told("an invalid line: 'hello, mocap'"))
    laboratory.lines = good
    before = len(bench.poses)
    wait_for(lambda: len(bench.poses) > before + 10)


def test_a_system_that_falls_silent_is_told_and_taken_up_again(
    bench: Bench, laboratory: Laboratory
) -> None:
    good, laboratory.lines = laboratory.lines, []
    wait_for(lambda: bench.told("no frames from udp"))
    before, laboratory.lines = len(bench.poses), good
    wait_for(lambda: len(bench.poses) > before + 10)
    assert bench.statuses[-1].gaps > 0


def test_a_system_without_frames_is_told_only_after_a_fair_start(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    try:
        port = str(free_port(socket.SOCK_DGRAM))
        bench.track("udp", "--host", "127.0.0.1", "--port", port, "--body", "quad1=cf7")
        wait_for(lambda: bench.told("no frames from udp"))
        problems = [status.problem for status in bench.statuses]
        quiet = next(k for k, problem in enumerate(problems) if problem)
        assert quiet * STATUS_PERIOD > 2 * GAP, problems
        assert problems[quiet].startswith("no frames from udp")
    finally:
        bench.close()


def test_a_second_process_for_the_same_vehicle_is_refused(
    bench: Bench, laboratory: Laboratory
) -> None:
    port = str(free_port(socket.SOCK_DGRAM))
    second = bench.track("udp", "--host", "127.0.0.1", "--port", port)
    assert second.wait(60) == 1
    assert not bench.statuses[-1].problem


def test_poses_of_a_ros_2_node_are_frames_of_their_topic(bench: Bench) -> None:
    source = Ros2Source(bench.page.session, ["/mocap/cf7/pose"])
    node = Node(bench.page.session, "/mocap", "driver")
    poses = node.advertise(Topic("cf7/pose", "geometry_msgs/PoseStamped", "tracker", 0))
    assert has_subscriber(poses, 10)
    sample = pose_sample(5_000_000_123, PLACE, (0.6, 0.0, 0.0, 0.8))
    poses.put(b"of another type")
    poses.put(pose_messages(sample).tobytes())
    with pytest.raises(MeasurementError, match=r"^/mocap/cf7/pose: "):  # not one that closes it
        next(source.frames())
    frame = next(source.frames())
    source.close()
    node.close()
    [body] = frame.bodies
    assert (frame.stamp_ns, body.name) == (5_000_000_123, "/mocap/cf7/pose")
    np.testing.assert_allclose(body.position_w, PLACE)
    assert body.quaternion_wb is not None
    np.testing.assert_allclose(body.quaternion_wb, (0.6, 0.0, 0.0, 0.8))


def test_a_tracker_process_that_dies_is_told(bench: Bench, laboratory: Laboratory) -> None:
    bench.events.clear()
    bench.children[0].kill()
    wait_for(lambda: bench.told("its process is silent"))
