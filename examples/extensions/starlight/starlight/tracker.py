"""The client of the tracking system starlight, which sends a line for each frame, in s and m, as
`{"t": 12.5, "bodies": {"cf7": [x, y, z, qw, qx, qy, qz]}}`, z up.
"""

import json
import socket
from collections.abc import Iterator, Mapping

import numpy as np

from console.trackers.source import Body, Connection, Frame
from quadrotor.errors import MeasurementError, UnreachableError
from vehicle_link.clock import monotonic_ns


class StarlightSource:
    """The connection to one server. Raises UnreachableError."""

    def __init__(self, host: str, port: int) -> None:
        try:
            self._socket = socket.create_connection((host, port), timeout=5.0)
        except OSError as error:
            raise UnreachableError(f"no starlight server at {host}:{port}: {error}") from None

    def frames(self) -> Iterator[Frame]:
        """Yield each frame as it arrives. Raises MeasurementError, UnreachableError."""
        try:
            for line in self._socket.makefile("rb"):
                yield parse(line, monotonic_ns())
        except OSError as error:
            raise UnreachableError(f"the starlight server sends nothing ({error})") from None

    def close(self) -> None:
        self._socket.close()


def parse(line: bytes, received_ns: int) -> Frame:
    """Return the frame of a line. Raises MeasurementError."""
    try:
        frame = json.loads(line)
        rows = {name: np.array(row, float).reshape(7) for name, row in frame["bodies"].items()}
        stamp_ns = round(1e9 * frame["t"])
    except (ValueError, KeyError, TypeError, OverflowError, AttributeError):
        raise MeasurementError(f"an invalid line: {line[:80]!r}") from None
    bodies = tuple(Body(name, row[:3], row[3:]) for name, row in rows.items())
    return Frame(stamp_ns, received_ns, bodies)


class Starlight:
    """The system, as `quadlab tracker starlight` and `quadlab up --tracker starlight` use it."""

    def check(self, bodies: Mapping[str, str]) -> None:
        """Accept all names of bodies."""

    def open(self, connection: Connection) -> StarlightSource:
        """Return the client. Raises UnreachableError."""
        return StarlightSource(connection.host, connection.port)


SYSTEM = Starlight()
