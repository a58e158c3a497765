"""The frame that every simulated tracking system sends, and functions that their servers share."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from quadrotor.errors import UsageError
from quadrotor.plain_rotations import Array
from vehicle.simulator.tracking_systems.faults import TrackingFaults

HOST = "127.0.0.1"
BEHIND = 1 << 18
"""Number of unread bytes from which a client is dropped."""


class Body(NamedTuple):
    """A body in the units and axes of the system.

    Position (3,), quaternion (4,) w x y z, body to world; `is_seen` is False while the cameras have
    lost it.
    """

    name: str
    position: Array
    quaternion: Array
    is_seen: bool = True


def in_system(name: str, position_w: Array, quaternion_wb: Array, faults: TrackingFaults) -> Body:
    """Return a vehicle's body in the axes and units of the system.

    With y up, x stays x, z becomes y and −y becomes z, in the world and in the body.
    """
    position, quaternion = position_w, quaternion_wb
    if faults.y_up:
        position = np.array((position[0], position[2], -position[1]))
        quaternion = np.array((quaternion[0], quaternion[1], quaternion[3], -quaternion[2]))
    if faults.millimetres:
        position = 1000.0 * position
    return Body(name, position, quaternion, not faults.body_lost)


class Server(Protocol):
    """Server of a system; nothing blocks, and one thread makes all calls."""

    def poll(self) -> None:
        """Answer the requests of clients since the last call."""
        ...

    def send(self, stamp_ns: int, bodies: Sequence[Body]) -> None:
        """Send a frame of all bodies, in a constant order, to each client."""
        ...

    def close(self) -> None: ...


def bound(kind: socket.SocketKind, port: int, system: str) -> socket.socket:
    """Return a non-blocking socket on this port of loopback. Raises UsageError."""
    found = socket.socket(socket.AF_INET, kind)
    if kind == socket.SOCK_STREAM:
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        found.bind((HOST, port))
        if kind == socket.SOCK_STREAM:
            found.listen()
    except OSError as error:
        found.close()
        raise UsageError(
            f"port {port} of the {system} server cannot be used ({error.strerror}); "
            f"stop what uses it or choose another, like --serve {system}={port + 10000}"
        ) from None
    found.setblocking(False)
    return found


def datagrams(source: socket.socket) -> list[tuple[bytes, tuple[str, int]]]:
    """Return all datagrams received, with their senders."""
    found = []
    with contextlib.suppress(OSError):  # none left, or the error of one sent to an unused port
        while True:
            found.append(source.recvfrom(65536))
    return found


class Client:
    """TCP client that the server never waits for.

    Attributes:
        received: bytes that are not consumed yet.
        is_open: False once the client has left, or left too much unread.
    """

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connection, self._unsent = connection, bytearray()
        self.received, self.is_open = bytearray(), True

    @property
    def address(self) -> str:
        return str(self._connection.getpeername()[0])

    def poll(self) -> None:
        try:
            while data := self._connection.recv(65536):
                self.received += data
            self.is_open = False
        except BlockingIOError:
            self.send(b"")
        except OSError:
            self.is_open = False

    def send(self, data: bytes) -> None:
        self._unsent += data
        try:
            while self._unsent:
                del self._unsent[: self._connection.send(self._unsent)]
        except BlockingIOError:
            self.is_open = len(self._unsent) <= BEHIND
        except OSError:
            self.is_open = False

    def close(self) -> None:
        self._connection.close()


def accepted(listener: socket.socket) -> list[Client]:
    """Return the clients that have connected."""
    found = []
    with contextlib.suppress(OSError):
        while True:
            found.append(Client(listener.accept()[0]))
    return found


def open_ones(clients: Sequence[Client]) -> list[Client]:
    """Close the clients that left and return the others."""
    for client in clients:
        if not client.is_open:
            client.close()
    return [client for client in clients if client.is_open]
