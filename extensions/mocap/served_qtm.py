"""A QTM server, as Qualisys Track Manager streams in real time, little-endian.

Sources: Qualisys' documentation of the QTM RT protocol, and what its public clients `qtm-rt` and
`qualisys_cpp_sdk` send and read. A client connects to the base port + 1, is greeted, chooses a
version, requests the bodies' names as XML and frames with the components 6D and 6DEuler, by TCP or
by UDP. Positions are in mm, rotations column by column or as angles of Rx · Ry · Rz in degrees; a
body that is not seen has NaN throughout; a stamp is in µs since the start.
"""

from __future__ import annotations

import contextlib
import math
import socket
import struct
from collections.abc import Callable, Mapping, Sequence
from xml.sax.saxutils import escape

from quadrotor.plain_rotations import matrix_of
from vehicle.simulator.tracking_systems.frame import Body, Client, accepted, bound, open_ones

PORT = 22222
ERROR, COMMAND, XML, DATA, EVENT = 0, 1, 2, 3, 6
CONNECTED = b"\1"
TURN = " ".join(f'R{i}{j}="{float(i == j)}"' for i in (1, 2, 3) for j in (1, 2, 3))
SETTINGS = (
    '<RGBColor>255</RGBColor><Enabled>true</Enabled><Color R="255" G="0" B="0"/>'
    "<MaximumResidual>10</MaximumResidual><MinimumMarkersInBody>3</MinimumMarkersInBody>"
    '<BoneLengthTolerance>5</BoneLengthTolerance><Filter Preset="No filter"/><Points/>'
    '<Data_origin X="0" Y="0" Z="0" Relative_body="0">0</Data_origin>'
    f'<Data_orientation {TURN} Relative_body="0">0</Data_orientation>'
)
EULER = "<Euler><First>Roll</First><Second>Pitch</Second><Third>Yaw</Third></Euler>"
LONGEST = 4096
"""Largest size, in bytes, of a command; a client that sends longer ones is disconnected."""


def _matrix(body: Body) -> Sequence[float]:
    return [*matrix_of(body.quaternion).T.ravel().tolist()]


def _euler(body: Body) -> Sequence[float]:
    """Return the angles of R = Rx · Ry · Rz."""
    r = matrix_of(body.quaternion)
    about_y = math.asin(max(-1.0, min(1.0, r[0, 2])))
    angles = math.atan2(-r[1, 2], r[2, 2]), about_y, math.atan2(-r[0, 1], r[0, 0])
    return [math.degrees(angle) for angle in angles]


COMPONENTS: Mapping[str, tuple[int, int, Callable[[Body], Sequence[float]]]] = {
    "6d": (5, 9, _matrix),
    "6deuler": (6, 3, _euler),
}
"""Components by name: (number, floats per rotation, rotation)."""
MARKERS = {"3d": 1, "3dnolabels": 2, "3dres": 9, "3dnolabelsres": 10}
"""Components of markers, which are sent empty."""


class QtmServer:
    """Server of the bodies of these names; clients connect to `port` + 1. Raises UsageError."""

    def __init__(self, names: Sequence[str], port: int = PORT) -> None:
        self._names, self._number = list(names), 0
        self._listener = bound(socket.SOCK_STREAM, port + 1, "qtm")
        self._datagrams = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._datagrams.setblocking(False)
        self._clients: list[Client] = []
        self._streams: dict[Client, tuple[int, list[str]]] = {}  # UDP port or 0, and components

    def poll(self) -> None:
        for client in accepted(self._listener):
            client.send(_packet(COMMAND, b"QTM RT Interface connected\0"))
            self._clients.append(client)
        for client in self._clients:
            client.poll()
            while len(client.received) >= 8:
                length, kind = struct.unpack_from("<II", client.received)
                if not 8 <= length <= LONGEST:
                    client.is_open = False
                    break
                if len(client.received) < length:
                    break
                text = client.received[8:length].rstrip(b"\0").decode(errors="replace")
                del client.received[:length]
                if kind == COMMAND:
                    client.send(self._answer(client, text.lower().split()))
        self._clients = open_ones(self._clients)
        self._streams = {one: how for one, how in self._streams.items() if one.is_open}

    def send(self, stamp_ns: int, bodies: Sequence[Body]) -> None:
        self._number += 1
        for client, (port, components) in self._streams.items():
            frame = self._frame(stamp_ns, bodies, components)
            if port:
                with contextlib.suppress(OSError):  # not read by the client
                    self._datagrams.sendto(frame, (client.address, port))
            else:
                client.send(frame)

    def close(self) -> None:
        for client in self._clients:
            client.close()
        self._listener.close()
        self._datagrams.close()

    def _answer(self, client: Client, words: Sequence[str]) -> bytes:
        match words:
            case ["version", version]:
                return _packet(COMMAND, f"Version set to {version}\0".encode())
            case ["qtmversion"]:
                return _packet(COMMAND, b"QTM Version is quadlab simulator\0")
            case ["byteorder"]:
                return _packet(COMMAND, b"Byte order is little endian\0")
            case ["getstate"]:
                return _packet(EVENT, CONNECTED)
            case ["getparameters", *_]:
                return _packet(XML, self._parameters())
            case ["streamframes", "stop"]:
                self._streams.pop(client, None)
                return b""
            case ["streamframes", "allframes", *rest]:
                port = 0
                if rest and rest[0].startswith("udp:"):
                    word = rest.pop(0).rpartition(":")[2]
                    port = int(word) if word.isdecimal() and int(word) < 65536 else -1
                if (
                    port >= 0
                    and rest
                    and all(word in COMPONENTS or word in MARKERS for word in rest)
                ):
                    self._streams[client] = port, rest
                    return b""
        return _packet(ERROR, b"Parse error\0")

    def _parameters(self) -> bytes:
        """Return the bodies' settings as XML, with elements of protocols before and since 1.21."""
        bodies = "".join(
            f"<Body><Name>{escape(name)}</Name>{SETTINGS}</Body>" for name in self._names
        )
        system = f"<The_6D><Bodies>{len(self._names)}</Bodies>{bodies}{EULER}</The_6D>"
        return f"<QTM_Parameters_Ver_1.25>{system}</QTM_Parameters_Ver_1.25>\0".encode()

    def _frame(self, stamp_ns: int, bodies: Sequence[Body], components: Sequence[str]) -> bytes:
        parts = b""
        seen = {body.name: body for body in bodies if body.is_seen}
        for component in components:
            if component in MARKERS:
                parts += struct.pack("<IIIhh", 16, MARKERS[component], 0, 0, 0)
                continue
            number, length, rotation = COMPONENTS[component]
            values: list[float] = []
            for name in self._names:
                if name in seen:
                    position = 1000.0 * seen[name].position
                    values += [*position.tolist(), *rotation(seen[name])]
                else:
                    values += [math.nan] * (3 + length)
            body = struct.pack(f"<ihh{len(values)}f", len(self._names), 0, 0, *values)
            parts += struct.pack("<II", 8 + len(body), number) + body
        head = struct.pack("<qII", stamp_ns // 1000, self._number & 0x7FFFFFFF, len(components))
        return _packet(DATA, head + parts)


def _packet(kind: int, body: bytes) -> bytes:
    return struct.pack("<II", 8 + len(body), kind) + body
