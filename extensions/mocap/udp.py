"""Frames as lines of text over UDP, which any program of a laboratory can send.

One datagram is one frame, with one line per body: `stamp,name,x,y,z` or
`stamp,name,x,y,z,qw,qx,qy,qz`, with the stamp in s of any clock (empty for none), m, z up.
"""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Iterator, Mapping

import numpy as np

from console.trackers.source import Body, Connection, Frame
from quadrotor.errors import LinkError, MeasurementError
from vehicle_link.clock import monotonic_ns

LARGEST = 65535
MARKER, RIGID = 5, 9
"""Number of fields of a line."""
LARGEST_NS = 2**63 - 1
"""Largest stamp: that of an int64, in the year 2262 if it counts from 1970."""


class UdpSource:
    """Frames that arrive at a UDP port of this host. Raises LinkError when it cannot be opened."""

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise LinkError(
                f"UDP port {port} of {host} cannot be listened on ({error.strerror or error}); "
                "stop what uses it, or choose another with --host and --port"
            ) from None

    def frames(self) -> Iterator[Frame]:
        """Yield one frame per datagram; end when closed. Raises MeasurementError."""
        while data := self._datagram():
            yield parse(data, monotonic_ns())

    def close(self) -> None:
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)  # wakes a waiting thread
        self._socket.close()

    def _datagram(self) -> bytes:
        try:
            return self._socket.recv(LARGEST)
        except OSError:  # closed
            return b""


class Udp:
    """Lines over UDP as a tracking system (`console.trackers.source.System`)."""

    def check(self, bodies: Mapping[str, str]) -> None:
        """Accept all names."""

    def open(self, connection: Connection) -> UdpSource:
        """Return the source, which listens. Raises LinkError."""
        return UdpSource(connection.host, connection.port)


SYSTEM = Udp()


def parse(data: bytes, received_ns: int) -> Frame:
    """Return the frame of a datagram. Raises MeasurementError."""
    stamp_ns, bodies = None, []
    for line in data.decode(errors="replace").splitlines():
        fields = [field.strip() for field in line.split(",")]
        try:
            if len(fields) not in (MARKER, RIGID) or not (fields[1] and fields[1].isprintable()):
                raise ValueError(line)
            stamp_ns = round(1e9 * float(fields[0])) if fields[0] else None
            if stamp_ns is not None and abs(stamp_ns) > LARGEST_NS:
                raise OverflowError(line)
            numbers = np.array(fields[2:], np.float64)
        except (ValueError, OverflowError):
            raise MeasurementError(
                f"an invalid line: {line[:80]!r}; send stamp,name,x,y,z[,qw,qx,qy,qz], with the "
                "stamp in s"
            ) from None
        bodies.append(Body(fields[1], numbers[:3], numbers[3:] if len(numbers) > 3 else None))
    return Frame(stamp_ns, received_ns, tuple(bodies))
