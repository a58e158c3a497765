"""A NatNet server, as OptiTrack's Motive streams by unicast: protocol 4.1, little-endian datagrams.

Sources: OptiTrack's description of the NatNet protocol (docs.optitrack.com, NatNet SDK), and what
the public clients `natnet` 0.3 and `libmotioncapture` read. A client requests the server's
description and the list of rigid bodies on the command port; frames are sent to the data port of
this host, and to each client that sends keep-alive datagrams (which then reads them on the port
that it sent them from).
"""

from __future__ import annotations

import contextlib
import socket
import struct
import time
from collections.abc import Sequence

from vehicle.simulator.tracking_systems.frame import HOST, Body, bound, datagrams

PORT, DATA_PORT = 1510, 1511
CONNECT, SERVER, MODEL_REQUEST, MODEL, FRAME, KEEP_ALIVE, UNKNOWN = 0, 1, 4, 5, 7, 10, 100
VERSION = (4, 1, 0, 0)
TICKS = 10_000_000
"""Number of ticks per second of the system's clock."""
KEPT = 5.0
"""Time, in s, for which frames are sent to a client after its keep-alive datagram."""
RIGID_BODY = 1
SEEN = 1
NO_GROUP = (0, 0, 0, 0)
"""Address of the multicast group: frames are sent to each client."""
NO_OFFSET = (0.0, 0.0, 0.0)
NO_TIME_CODE, NO_FLAGS_AND_END = (0, 0), (0, 0)


class NatNetServer:
    """Server of the bodies of these names, numbered from 1. Raises UsageError."""

    def __init__(self, names: Sequence[str], port: int = PORT) -> None:
        self._names = list(names)
        self._socket = bound(socket.SOCK_DGRAM, port, "natnet")
        self._data = HOST, DATA_PORT if port == PORT else port + 1
        self._kept: dict[tuple[str, int], float] = {}
        self._number = 0

    def poll(self) -> None:
        for data, sender in datagrams(self._socket):
            kind = struct.unpack_from("<H", data)[0] if len(data) >= 4 else UNKNOWN
            if kind == CONNECT:
                self._put(SERVER, self._facts(), sender)
            elif kind == MODEL_REQUEST:
                self._put(MODEL, self._model(), sender)
            elif kind == KEEP_ALIVE:
                self._kept[sender] = time.monotonic()
            else:
                self._put(UNKNOWN, b"", sender)
        now = time.monotonic()
        self._kept = {one: heard for one, heard in self._kept.items() if now - heard < KEPT}

    def send(self, stamp_ns: int, bodies: Sequence[Body]) -> None:
        self._number += 1
        frame = self._frame(stamp_ns, bodies)
        for client in (self._data, *self._kept):
            self._put(FRAME, frame, client)

    def close(self) -> None:
        self._socket.close()

    def _put(self, kind: int, body: bytes, client: tuple[str, int]) -> None:
        with contextlib.suppress(OSError):  # not read by any client
            self._socket.sendto(struct.pack("<HH", kind, len(body)) + body, client)

    def _facts(self) -> bytes:
        name = b"quadlab simulator".ljust(256, b"\0")
        versions = bytes((1, 0, 0, 0)) + bytes(VERSION)
        return name + versions + struct.pack("<QH?4B", TICKS, self._data[1], False, *NO_GROUP)

    def _model(self) -> bytes:
        found = struct.pack("<I", len(self._names))
        for number, name in enumerate(self._names, 1):
            # Number, parent, offset, and no markers.
            body = name.encode() + b"\0" + struct.pack("<Ii3fI", number, -1, *NO_OFFSET, 0)
            found += struct.pack("<II", RIGID_BODY, len(body)) + body
        return found

    def _frame(self, stamp_ns: int, bodies: Sequence[Body]) -> bytes:
        rigid = b""
        for body in bodies:
            w, *xyz = body.quaternion.tolist()
            number = self._names.index(body.name) + 1
            values = *body.position.tolist(), *xyz, w, 0.0
            rigid += struct.pack("<I8fH", number, *values, SEEN * body.is_seen)
        none = struct.pack("<II", 0, 0)
        # Marker sets and other markers; then skeletons, assets, markers, force plates, devices.
        parts = struct.pack("<I", self._number) + 2 * none
        parts += struct.pack("<II", len(bodies), len(rigid)) + rigid + 5 * none
        ticks = stamp_ns * TICKS // 1_000_000_000
        when = 1e-9 * stamp_ns, ticks, ticks, ticks  # since the start; exposed, arrived, sent
        return parts + struct.pack("<IIdQQQHI", *NO_TIME_CODE, *when, *NO_FLAGS_AND_END)
