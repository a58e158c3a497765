"""A real station, and a real vehicle's comms and flight loop, in one process over the real link."""

from __future__ import annotations

import os
import select
import socket
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from console.base_station import BaseStation
from console.beacon_layout import VEHICLE_LAYOUT
from console.catalogue.catalogue import Catalogue
from console.station_parts import StationOptions
from quadrotor.motor_state import MotorState
from quadrotor.parameter_description import ParameterValue
from tests.waiting import free_port, until
from vehicle.boards.board import Command, RawSample
from vehicle.comms.process import Comms
from vehicle.flight.loop import FlightLoop
from vehicle.flight.pacing import PortPacer
from vehicle.flight.stack import FlightStack
from vehicle.parameters import new_parameters
from vehicle.processes.config import VehicleConfig, create_rings, open_rings
from vehicle_link.messages import new
from vehicle_link.parameters.messages import to_parameters
from vehicle_link.process_instance import new_instance
from vehicle_link.security.authority import ensure_certificates
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.heartbeat import LinkState
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.radio import Radio
from vehicle_link.transport.session import hub_session, vehicle_session

WAKE_NS = 50_000_000


class Relay:
    """UDP port that leads to the present vehicle; a closed session may keep its port for long."""

    def __init__(self) -> None:
        self._near = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._near.bind(("127.0.0.1", 0))
        self._near.setblocking(False)
        self.port: int = self._near.getsockname()[1]
        self._far: dict[socket.socket, Any] = {}  # socket to the vehicle → source of its packets
        self._vehicle_port = 0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def lead_to(self, port: int) -> None:
        self._vehicle_port, self._far = port, {}

    def close(self) -> None:
        self._closing.set()
        self._thread.join(5)

    def _run(self) -> None:
        while not self._closing.is_set():
            ready, _, _ = select.select([self._near, *self._far], [], [], 0.02)
            for one in ready:
                with suppress(OSError, KeyError):  # no receiver, or no longer
                    if one is self._near:
                        data, source = one.recvfrom(65536)
                        self._towards_vehicle(source).send(data)
                    else:
                        self._near.sendto(one.recv(65536), self._far[one])

    def _towards_vehicle(self, source: Any) -> socket.socket:
        for far, known in self._far.items():
            if known == source:
                return far
        far = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        far.connect(("127.0.0.1", self._vehicle_port))
        far.setblocking(False)  # a send may have consumed the refusal that select saw
        self._far[far] = source
        return far


class StillMicrocontroller:
    """Samples of a vehicle on the ground: one at each call, however late.

    A loop that catches up would leave the other threads of this process no time.
    """

    def __init__(self) -> None:
        self.failures: list[str] = []
        self.newest_ms: list[int] = []
        self.lost_ports = self.damaged = self.refused = self.late = 0
        self.obstacle = ""
        self.motor_state = MotorState.OFF

    def receive(self) -> list[RawSample]:
        still, battery, pressure = (512, 512, 512), 12.0, 101_325.0
        return [RawSample(time.time_ns(), still, still, battery, pressure, self.motor_state)]

    def command(self, command: Command) -> None: ...
    def set_command_timeout(self, milliseconds: int) -> None: ...
    def set_motor_state(self, state: MotorState) -> None: ...
    def service(self, now_s: float) -> None: ...
    def filenos(self) -> Sequence[int]:
        return ()


class Vehicle:
    """Flight loop and comms as in their processes, but in threads."""

    def __init__(self, data: Path, port: int) -> None:
        descriptors = create_rings()
        rings = open_rings(descriptors)
        self.stack = FlightStack(new_parameters())
        self.microcontroller = StillMicrocontroller()
        pacer = PortPacer(self.microcontroller, WAKE_NS)
        self._loop = FlightLoop(self.stack, self.microcontroller, rings, pacer, real_time=False)
        self._session = vehicle_session(
            port, ensure_certificates(data / "certificates"), "127.0.0.1"
        )
        config = VehicleConfig(
            parent=os.getpid(),
            rings=descriptors,
            data=str(data / "vehicle"),
            link_port=port,
            instance=new_instance(),
        )
        self._node = Node(self._session, "/quad1", "vehicle")
        self._comms = Comms(config, rings, self._node)
        self._stopping = threading.Event()
        self._threads = [
            threading.Thread(target=self._loop.run, daemon=True),
            threading.Thread(target=self._comms.run, args=(self._stopping,), daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    @property
    def layout(self) -> str:
        return self.stack.parameters.beacons.layout

    def close(self) -> None:
        self._loop.stop()
        self._stopping.set()
        for thread in self._threads:
            thread.join(5)
        self._comms.close()
        self._node.close()
        self._session.close()


class LinkedBench:
    """A station and its client; vehicles come and go."""

    def __init__(self, data: Path) -> None:
        self._data = data
        self._relay, loopback = Relay(), free_port(socket.SOCK_STREAM)
        files = ensure_certificates(data / "certificates")
        self._hub, instance = hub_session(loopback), new_instance()
        self.catalogue = Catalogue(data)
        settings = {"station.recorder.keep_free": 10.0}
        self.station = BaseStation(
            self._hub, self.catalogue, StationOptions(settings=settings, instance=instance)
        )
        self._radio = Radio(
            f"127.0.0.1:{self._relay.port}", files, loopback, self.station.link.session_silence
        )
        self.station.link.follow(self._radio)
        self._session = loopback_session(loopback)
        self.page = Node(self._session, "/quad1", "page")
        self.vehicle: Vehicle | None = None

    @property
    def layout(self) -> str:
        return self.station.parts.store.parameters.bearings.layout

    def connect(self) -> Vehicle:
        if self.vehicle is not None:  # of a failed test; two at a time would be refused
            self.disconnect()
        port = free_port(socket.SOCK_DGRAM)
        self._relay.lead_to(port)
        self.vehicle = Vehicle(self._data, port)
        assert until(lambda: self.station.link.state() is LinkState.GOOD)
        known = self.station.parts.vehicle_parameters.known
        assert until(lambda: known(VEHICLE_LAYOUT) == self.layout), "they did not come to agree"
        return self.vehicle

    def disconnect(self) -> None:
        assert self.vehicle is not None
        self.vehicle.close()
        self.vehicle = None
        assert until(lambda: self.station.link.state() is LinkState.LOST)

    def call(self, service: str, **fields: Any) -> Any:
        request = new(
            f"{SERVICES[service]}_Request",
            request_id=f"r{time.monotonic_ns()}",
            requester="ada",
            **fields,
        )
        return self.page.client(f"station/{service}", SERVICES[service]).call(request, timeout=5.0)

    def change(self, name: str, value: ParameterValue) -> Any:
        """Return the station's answer to a change of one parameter; a lost link is awaited."""
        for _ in range(5):
            if self.vehicle is not None:
                assert until(lambda: self.station.link.state() is LinkState.GOOD)
            answer = self.call("change_parameters", parameters=to_parameters({name: value}))
            if answer.accepted or self.station.link.state() is LinkState.GOOD:
                break
        return answer

    def close(self) -> None:
        if self.vehicle is not None:
            self.vehicle.close()
        self.page.close()
        self._session.close()
        self._radio.close()
        self.station.close()
        self._hub.close()
        self._relay.close()


@pytest.fixture(scope="module")
def linked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LinkedBench]:
    """Yield a station to which no vehicle has connected yet."""
    bench = LinkedBench(tmp_path_factory.mktemp("data"))
    yield bench
    bench.close()
