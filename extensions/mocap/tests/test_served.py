"""The simulator's pose servers, judged by third-party clients."""

from __future__ import annotations

import asyncio
import itertools
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import qtm_rt
from natnet import DataDescriptions, DataFrame, NatNetClient
from qtm_rt.packet import QRTPacket

from bearing_sim import TrackerParameters
from console.trackers.health import to_world
from console.trackers.source import Body, Connection, Frame, System
from quadrotor.errors import UnreachableError, UsageError
from quadrotor.extension import TrackingSystem
from quadrotor.extensions import registry
from quadrotor.plain_rotations import matrix_of
from tests.waiting import LIMIT, free_port, until, wait_for
from vehicle.simulator.tracking_systems.faults import TrackingFaults
from vehicle.simulator.tracking_systems.frame import bound
from vehicle.simulator.tracking_systems.served import ServedSystems, known_systems, parse_systems

NAMES = ("quad1", "cf7")
PERIOD = 0.01
EPOCH_NS = 1_790_000_000_000_000_000
TURN = np.array([0.1, 0.2, 0.3, np.sqrt(0.86)])  # no two numbers alike


def place(name: str, k: int) -> np.ndarray:
    return np.array([0.001 * k, -2.0 + NAMES.index(name), 3.0])


class Laboratory:
    """Two bodies at 100 Hz, the k-th pose of each at `place`, without noise."""

    def __init__(self, system: str, port: int) -> None:
        exact = TrackerParameters(position_noise=0.0, attitude_noise=0.0)
        self.port = port
        self.served = ServedSystems({system: port}, NAMES, exact, TrackingFaults())
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._stop.set()
        self._thread.join(5)
        self.served.close()

    def _run(self) -> None:
        for k in itertools.count():
            if self._stop.wait(PERIOD):
                return
            for name in NAMES:
                self.served.offer(name, EPOCH_NS + 10_000_000 * k, place(name, k), TURN)


def is_free(port: int) -> bool:
    """Return whether no server has this port, of TCP and of UDP."""
    try:
        for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM):
            bound(kind, port, "probe").close()
    except UsageError:
        return False
    return True


@contextmanager
def laboratory(system: str) -> Iterator[Laboratory]:
    running = Laboratory(system, free_port())
    try:
        yield running
    finally:
        running.close()


@contextmanager
def frames_of(system: str, port: int) -> Iterator[Iterator[Frame]]:
    """Yield the library's frames.

    For QTM, wait until no other client on this computer has the one UDP port that the library can
    use.
    """
    end = time.monotonic() + LIMIT
    while True:
        client: System = registry().offers(TrackingSystem)[system].load()
        source = client.open(Connection("127.0.0.1", port, None, {}, Path()))
        frames = source.frames()
        try:
            first = next(frames)
            break
        except UnreachableError:
            if time.monotonic() > end:
                raise
    try:
        yield itertools.chain([first], frames)
    finally:
        source.close()
        for _ in frames:  # ends, and the library's process with it
            pass


def check(body: Body) -> int:
    """Check a pose in every value; return its number."""
    k = round(1000.0 * float(body.position_w[0]))
    np.testing.assert_allclose(body.position_w, place(body.name, k), atol=1e-5)
    assert body.quaternion_wb is not None
    quaternion = body.quaternion_wb * np.sign(body.quaternion_wb @ TURN)
    np.testing.assert_allclose(quaternion, TURN, atol=1e-5)
    return k


@pytest.mark.parametrize("system", known_systems())
def test_poses_arrive_in_the_library_as_they_were_served(system: str) -> None:
    with laboratory(system) as running, frames_of(system, running.port) as frames:
        seen: dict[str, list[int]] = {name: [] for name in NAMES}
        for frame in itertools.islice(frames, 100):
            for body in frame.bodies:
                seen[body.name].append(check(body))
    for numbers in seen.values():
        assert numbers == sorted(numbers)
        assert len(set(numbers)) >= 50


@pytest.mark.parametrize("system", known_systems())
def test_a_body_is_lost_turned_to_y_up_and_its_server_restarted_as_asked(system: str) -> None:
    with laboratory(system) as running:
        served = running.served
        with frames_of(system, running.port) as frames:
            next(frames)
            served.set_faults("cf7", TrackingFaults(body_lost=True))
            for frame in frames:
                if [body.name for body in frame.bodies] == ["quad1"]:
                    break
            served.set_faults("cf7", TrackingFaults(y_up=True, millimetres=True))
            for frame in frames:
                found = [body for body in frame.bodies if body.name == "cf7"]
                if found:
                    check(to_world(found[0], "mm", "y"))
                    break
        served.set_faults("quad1", TrackingFaults(stopped=True))
        wait_for(lambda: is_free(running.port))
        served.set_faults("quad1", TrackingFaults())
        with frames_of(system, running.port) as frames:
            assert next(frames).bodies


def test_served_natnet_is_read_with_its_stamps_by_another_client() -> None:
    frames: list[DataFrame] = []
    models: list[DataDescriptions] = []
    with laboratory("natnet") as running:
        client = NatNetClient(command_port=running.port, use_multicast=False)
        client.on_data_frame_received_event.handlers.append(frames.append)
        client.on_data_description_received_event.handlers.append(models.append)
        with client:
            client.request_modeldef()

            def has_read() -> bool:
                client.update_sync()
                return len(frames) > 20 and bool(models)

            wait_for(has_read)
            running.served.set_faults(NAMES[0], TrackingFaults(stamps_ahead=1.0))
            count = len(frames)

            def has_jumped() -> bool:
                client.update_sync()
                return bool(frames[-1].suffix.timestamp > frames[count - 1].suffix.timestamp + 1.0)

            assert until(has_jumped)
    assert [body.name for body in models[0].rigid_bodies] == list(NAMES)
    for frame in frames[:count]:
        assert [body.tracking_valid for body in frame.rigid_bodies] == [True, True]
        for body, name in zip(frame.rigid_bodies, NAMES, strict=True):
            x, y, z, w = body.rot
            k = check(Body(name, np.array(body.pos), np.array((w, x, y, z))))
            stamp_ns = EPOCH_NS + 10_000_000 * k
            assert 100 * frame.suffix.stamp_camera_mid_exposure == stamp_ns


def test_served_qtm_is_read_with_its_stamps_by_the_makers_client() -> None:
    async def read(port: int) -> tuple[bytes, list[QRTPacket]]:
        connection = await qtm_rt.connect("127.0.0.1", port + 1)
        settings = await connection.get_parameters(["6d"])
        came: list[QRTPacket] = []
        enough = asyncio.Event()

        def take(packet: QRTPacket) -> None:
            came.append(packet)
            if len(came) == 20:
                enough.set()

        await connection.stream_frames(components=["6d"], on_packet=take)
        await asyncio.wait_for(enough.wait(), 20)
        connection.disconnect()
        return settings, came

    with laboratory("qtm") as running:
        settings, packets = asyncio.run(read(running.port))
    tree = ElementTree.fromstring(settings)
    assert [name.text for name in tree.iterfind("The_6D/Body/Name")] == list(NAMES)
    for packet in packets:
        _, bodies = packet.get_6d()
        for (position, rotation), name in zip(bodies, NAMES, strict=True):
            k = check(Body(name, 1e-3 * np.array(position), TURN))
            columns = np.reshape(rotation.matrix, (3, 3))
            np.testing.assert_allclose(columns.T, matrix_of(TURN), atol=1e-6)
            assert 1000 * packet.timestamp == EPOCH_NS + 10_000_000 * k


def test_systems_and_ports_that_cannot_be_served_are_named() -> None:
    assert parse_systems(["vrpn", "natnet=2000"]) == {"vrpn": 3883, "natnet": 2000}
    for word in ("vicon", "vrpn=", "vrpn=70000"):
        with pytest.raises(UsageError, match=word):
            parse_systems([word])
    with laboratory("vrpn") as running, pytest.raises(UsageError, match=str(running.port)):
        ServedSystems({"vrpn": running.port}, NAMES, TrackerParameters(), TrackingFaults())
