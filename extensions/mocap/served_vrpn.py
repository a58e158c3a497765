"""A VRPN server: one tracker per body.

Sources: the public VRPN library (vrpn_Connection.C, vrpn_Tracker.C; version 07.38) and its protocol
notes. A client either requests a TCP connection back by a UDP datagram "address port", or connects
itself. Both sides then send a cookie and describe their senders and types by number; a message has
a big-endian header (length, s, µs, sender, type, sequence number) and a body padded to 8 bytes. A
pose is a sensor's number twice, x y z and the quaternion x y z w as doubles, sensor to world.
"""

from __future__ import annotations

import contextlib
import socket
import struct
from collections.abc import Sequence

from vehicle.simulator.tracking_systems.frame import (
    HOST,
    Body,
    Client,
    accepted,
    bound,
    datagrams,
    open_ones,
)

PORT = 3883
COOKIE = b"vrpn: ver. 07.38  0".ljust(24, b"\0")
HEADER = struct.Struct(">IIIiiI")
SENDER, TYPE = -1, -2
TYPES = (b"vrpn_Tracker Pos_Quat", b"vrpn_Base pong_message")
POSE, PONG = 0, 1
PING = b"vrpn_Base ping_message"
CALL_WAIT = 0.2
"""Time, in s, for a client on this host to accept a connection."""


class VrpnServer:
    """Server of the bodies of these names. Raises UsageError."""

    def __init__(self, names: Sequence[str], port: int = PORT) -> None:
        self._names = [name.encode() for name in names]
        self._listener = bound(socket.SOCK_STREAM, port, "vrpn")
        try:
            self._asked = bound(socket.SOCK_DGRAM, port, "vrpn")
        except BaseException:
            self._listener.close()
            raise
        self._clients: list[_Client] = []

    def poll(self) -> None:
        for data, _ in datagrams(self._asked):
            with contextlib.suppress(OSError, ValueError, UnicodeDecodeError):
                _, port = data.rstrip(b"\0").decode().split()
                # The address is the client's view of itself; only this host is served.
                called = socket.create_connection((HOST, int(port)), CALL_WAIT)
                self._clients.append(_Client(Client(called), self._names))
        self._clients += [_Client(one, self._names) for one in accepted(self._listener)]
        for client in self._clients:
            client.poll()
        remaining = open_ones([client.link for client in self._clients])
        self._clients = [client for client in self._clients if client.link in remaining]

    def send(self, stamp_ns: int, bodies: Sequence[Body]) -> None:
        for body in bodies:
            if body.is_seen:
                w, *xyz = body.quaternion.tolist()
                pose = struct.pack(">ii7d", 0, 0, *body.position.tolist(), *xyz, w)
                sender = self._names.index(body.name.encode())
                message = _message(stamp_ns, sender, POSE, pose)
                for client in self._clients:
                    if client.is_greeted:
                        client.link.send(message)

    def close(self) -> None:
        for client in self._clients:
            client.link.close()
        self._listener.close()
        self._asked.close()


class _Client:
    """A client, which greets, describes itself, and may then ping the server."""

    def __init__(self, link: Client, names: Sequence[bytes]) -> None:
        self.link, self._names = link, list(names)
        self.is_greeted = False
        self._senders: dict[int, bytes] = {}
        self._ping: int | None = None
        link.send(COOKIE)

    def poll(self) -> None:
        self.link.poll()
        received = self.link.received
        if not self.is_greeted:
            if len(received) < len(COOKIE):
                return
            if received[:11] != COOKIE[:11]:
                self.link.is_open = False
                return
            del received[: len(COOKIE)]
            self.is_greeted = True
            for kind, names in ((SENDER, self._names), (TYPE, TYPES)):
                for number, name in enumerate(names):
                    self.link.send(_message(0, number, kind, _text(name)))
        while len(received) >= HEADER.size:
            length, _, _, sender, kind, _ = HEADER.unpack_from(received)
            padded = -(-length // 8) * 8
            if len(received) < padded:
                break
            body = bytes(received[HEADER.size : length])
            del received[: max(padded, HEADER.size)]
            self._take(kind, sender, body)

    def _take(self, kind: int, sender: int, body: bytes) -> None:
        name = body[4:].rstrip(b"\0")
        if kind == SENDER:
            self._senders[sender] = name
        elif kind == TYPE and name == PING:
            self._ping = sender
        elif kind == self._ping and self._senders.get(sender) in self._names:
            self.link.send(_message(0, self._names.index(self._senders[sender]), PONG, b""))


def _text(name: bytes) -> bytes:
    return struct.pack(">I", len(name) + 1) + name + b"\0"


def _message(stamp_ns: int, sender: int, kind: int, body: bytes) -> bytes:
    seconds, rest = divmod(stamp_ns, 1_000_000_000)
    header = HEADER.pack(
        HEADER.size + len(body), seconds & 0xFFFFFFFF, rest // 1000, sender, kind, 0
    )
    return header + body + bytes(-len(body) % 8)
