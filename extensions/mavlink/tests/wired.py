"""A gateway on a free port, a station made of plain lists, and ground stations of pymavlink."""

from __future__ import annotations

import queue
import socket
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from extensions.mavlink.dialect import mavlink
from extensions.mavlink.frames import parse_origin
from extensions.mavlink.gateway import Gateway
from extensions.mavlink.link import Link, parse_endpoint
from extensions.mavlink.peer import Peer
from extensions.mavlink.vehicle import Vehicle
from quadrotor.errors import RefusedError
from quadrotor.parameters import ParameterStore
from vehicle.parameters import new_parameters
from vehicle_link.clock import monotonic_ns
from vehicle_link.messages import decode, encode, header, new
from vehicle_link.parameters.messages import from_parameters, to_parameters

PATIENCE = 10.0


class Station:
    """A station for the gateway: it accepts, unless another requester has control."""

    def __init__(self) -> None:
        self.store = ParameterStore(new_parameters())
        self.asked: list[tuple[str, str, dict[str, Any]]] = []
        self.holder, self.closed = "", list[str]()
        self.payloads: dict[str, bytes] = {}
        self.references: list[bytes] = []
        self.sticks: list[bytes] = []
        self.at = (1.0, 2.0, 0.5)
        self.show()

    def show(
        self,
        behavior: str = "ground",
        armed: bool = False,
        mode: str = "ready",
        at: tuple[float, float, float] | None = None,
    ) -> None:
        """Show this status, and an estimate that rests at a point, where it was if None."""
        self.behavior, self.armed, self.mode = behavior, armed, mode
        self.at = at = at or self.at
        self.show_status(airborne=armed)
        odometry = new("nav_msgs/Odometry", header=header(5_000_000_000, "world"))
        place = odometry.pose.pose.position
        place.x, place.y, place.z = at
        odometry.pose.pose.orientation.w = 1.0
        reference = new(
            "quadlab_msgs/Reference",
            header=header(5_000_000_000, "world"),
            position=dict(zip("xyz", at, strict=True)),
        )
        messages = {"state": odometry, "reference": reference}
        self.payloads.update({name: encode(message) for name, message in messages.items()})

    def show_status(self, *, airborne: bool) -> None:
        """Show the present status, in the air or on the ground."""
        status = new(
            "quadlab_msgs/VehicleStatus",
            header=header(1),
            mode=self.mode,
            behavior=self.behavior,
            armed=self.armed,
            airborne=airborne,
        )
        self.payloads["status"] = encode(status)

    def show_holder(self, name: str) -> None:
        """Show who has control."""
        control = new("quadlab_msgs/ControlStatus", header=header(1), holder=name)
        self.payloads["control"] = encode(control)

    def newest_payload(self, topic: str) -> Callable[[], tuple[bytes, int] | None]:
        def newest() -> tuple[bytes, int] | None:
            payload = self.payloads.get(topic)
            return None if payload is None else (payload, monotonic_ns())

        return newest

    def advertise(self, topic: str) -> Any:
        return SimpleNamespace(put=self.sticks.append) if topic == "stick" else self

    def put(self, payload: bytes, source_ns: int | None = None) -> None:
        self.references.append(payload)

    def connect(self, name: str) -> Any:
        return SimpleNamespace(
            ask=lambda service, **fields: self.ask(name, service, **fields),
            close=lambda: self.closed.append(name),
            descriptions=lambda: list(self.store.descriptions()),
            parameters=self.store.values,
        )

    def ask(self, who: str, service: str, **fields: Any) -> Any:
        if service != "emergency" and self.holder not in ("", who):
            raise RefusedError(f"{self.holder} has control; ask for it, or wait")
        self.asked.append((who, service, fields))
        if service == "change_parameters":
            applied = self.store.set(from_parameters(fields["parameters"]))
            return SimpleNamespace(applied=to_parameters(applied))
        if service == "start_behavior":
            self.show(fields["name"], armed=True, mode="armed")
        return SimpleNamespace()


class IdealStation(Station):
    """A station whose vehicle is at once where it shall be."""

    def put(self, payload: bytes, source_ns: int | None = None) -> None:
        super().put(payload, source_ns)
        place = decode(payload, "quadlab_msgs/Reference").position
        self.show(self.behavior, self.armed, self.mode, (place.x, place.y, place.z))

    def ask(self, who: str, service: str, **fields: Any) -> Any:
        answer = super().ask(who, service, **fields)
        if service == "arm":
            self.show("ground", True, "armed", (0.0, 0.0, 0.0))
        elif fields.get("name") == "take_off":
            self.show("hover", True, "armed", (0.0, 0.0, 0.8))
        elif fields.get("name") == "land":
            self.show()
        return answer


class Wired:
    """The gateway, and what it printed."""

    def __init__(
        self,
        data: Path,
        *,
        viewers: bool = False,
        passphrase: str = "",
        unsigned: bool = True,
        station: Station | None = None,
        kind: str = "udpin",
    ) -> None:
        from console.catalogue.catalogue import Catalogue
        from extensions.mavlink.logs import Logs

        self.station, self.lines = station or Station(), list[str]()
        self.events: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self.changes: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self.kind = socket.SOCK_STREAM if kind == "tcpin" else socket.SOCK_DGRAM
        with socket.socket(socket.AF_INET, self.kind) as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]

        def open_link(has_left: Callable[[Peer], None]) -> Link:
            endpoints = [parse_endpoint(f"{kind}:127.0.0.1:{self.port}")]
            self.link = Link(endpoints, passphrase, self.lines.append, has_left, unsigned=unsigned)
            return self.link

        self.logs = Logs(Catalogue(data), "quad1")
        self.gateway = Gateway(
            open_link,
            Vehicle(self.station),
            self.station.connect,
            self.logs,
            self.station.advertise,
            self.changes,
            self.events,
            parse_origin("47.4,8.5,0"),
            viewers=viewers,
            say=self.lines.append,
        )

    def ground(self, system: int = 255, passphrase: str = "") -> Ground:
        return Ground(self, system, passphrase)

    def close(self) -> None:
        self.gateway.close()


class Ground:
    """A ground station: what it sends is taken in the gateway's next turn."""

    def __init__(self, wired: Wired, system: int, passphrase: str) -> None:
        import hashlib

        self._wired = wired
        self.socket = socket.socket(socket.AF_INET, wired.kind)
        if wired.link.peers and wired.link.peers[0].is_fixed:  # it is sent to
            self.socket.bind(wired.link.peers[0].address)
            self.socket.connect(wired.link.peers[0].socket.getsockname())
        else:
            self.socket.connect(("127.0.0.1", wired.port))
        self.socket.setblocking(False)
        self.mav = mavlink.MAVLink(self, system, 190)
        self.mav.robust_parsing = True
        if passphrase:
            self.mav.signing.secret_key = hashlib.sha256(passphrase.encode()).digest()
            self.mav.signing.sign_outgoing = True
            self.mav.signing.timestamp = int((time.time() - 1_420_070_400) * 100_000)
        self.got: list[Any] = []

    def write(self, data: bytes) -> None:
        self.socket.send(data)

    def turn(self) -> None:
        self._wired.gateway.turn(0.01)
        while True:
            try:
                data = self.socket.recv(2048)
            except (BlockingIOError, ConnectionError):
                return
            if not data:  # the gateway has closed the connection
                return
            self.got += self.mav.parse_buffer(data) or []

    def until(self, what: str, look: Callable[[Any], bool] = lambda message: True) -> Any:
        """Turn until a message of this type has come for which `look` is true."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            for k, message in enumerate(self.got):
                if message.get_type() == what and look(message):
                    del self.got[: k + 1]
                    return message
            self.turn()
        raise AssertionError(f"no {what} came; {self._wired.lines}")

    def command(self, command: int, *numbers: float) -> int:
        """Give a command; return its final result."""
        padded = (*numbers, *[0.0] * (7 - len(numbers)))
        self.mav.command_long_send(1, 1, command, 0, *padded)
        acknowledged = self.until(
            "COMMAND_ACK",
            lambda m: m.command == command and m.result != mavlink.MAV_RESULT_IN_PROGRESS,
        )
        return int(acknowledged.result)

    def text(self, part: str) -> str:
        """Return the STATUSTEXT with this part, put together of its pieces."""
        said: dict[int, str] = {}

        def is_it(message: Any) -> bool:
            said[message.id] = said.get(message.id, "") * bool(message.chunk_seq) + message.text
            return part in said[message.id] and len(message.text) < 50  # its last piece

        return said[self.until("STATUSTEXT", is_it).id]
