"""The ports that bytes go through, and one in memory for a vehicle that flies in simulated time.

A serial device is a `vehicle_link.serial.serial_port.SerialPort`.
"""

from __future__ import annotations

from enum import Enum
from typing import Protocol

from quadrotor.errors import LinkError

BAUD_RATE = 115_200
BUFFER = 4096
"""Bytes that one kernel buffer of a terminal holds."""


class PortProblem(Enum):
    """The reasons why a serial device cannot be used."""

    MISSING = "no such device"
    BUSY = "busy"
    FORBIDDEN = "permission denied"
    NOT_SERIAL = "not a serial device"
    FAILED = "cannot be opened"
    UNPLUGGED = "gone"


class PortError(LinkError):
    """A serial device cannot be opened, or was lost. `why` is the message without the path."""

    def __init__(self, problem: PortProblem, path: str, why: str) -> None:
        verb = "is gone" if problem is PortProblem.UNPLUGGED else "cannot be opened"
        super().__init__(f"serial port {path} {verb}: {why}")
        self.problem = problem
        self.why = why


class Port(Protocol):
    """One serial line, read and written without ever waiting."""

    def read(self) -> bytes:
        """Return everything that has arrived, maybe nothing. Raises LinkError if the line broke."""

    def write(self, data: bytes) -> None:
        """Send, or drop when the line is congested. Raises LinkError when the line is lost."""

    def fileno(self) -> int:
        """Return the file descriptor for poll(). Raises LinkError when this port has none."""

    def close(self) -> None: ...


class MemoryPort:
    """One end of a serial line in memory; made in pairs by `memory_port_pair`.

    Holds as much as a kernel's buffer; `dropped` counts the writes that did not fit.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self._arrived = b""
        self._peer = self
        self._plugged: MemoryPort | None = None  # the other end while it is unplugged
        self._gone = False

    def read(self) -> bytes:
        data = self._arrived
        if data:
            self._arrived = b""
        elif self._gone:
            raise self._error()
        return data

    def write(self, data: bytes) -> None:
        if self._gone:
            raise self._error()
        peer = self._peer
        waiting = peer._arrived
        if not waiting:
            peer._arrived = data
        elif len(waiting) + len(data) <= BUFFER:
            peer._arrived = waiting + data
        else:
            self.dropped += 1

    def fileno(self) -> int:
        raise LinkError("a port in memory has no file to poll; use a serial device or pty instead")

    def close(self) -> None:
        self._arrived = b""

    def unplug(self) -> None:
        """Unplug the other end's adapter: reading there fails, and nothing more arrives here."""
        if self._plugged is None:
            self._plugged, self._peer = self._peer, MemoryPort()
            self._plugged._gone = True
            self._plugged._arrived = self._arrived = b""

    def plug_in(self) -> None:
        """Plug the other end's adapter in again."""
        if self._plugged is not None:
            self._peer, self._plugged = self._plugged, None
            self._peer._gone = False

    def _error(self) -> PortError:
        return PortError(PortProblem.UNPLUGGED, "in memory", "pulled out; fly again to plug it in")


def memory_port_pair() -> tuple[MemoryPort, MemoryPort]:
    """Return two connected ends."""
    one, other = MemoryPort(), MemoryPort()
    one._peer, other._peer = other, one
    return one, other
