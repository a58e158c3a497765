"""The serial ports of one microcontroller: frames are read from all, and written to one or in turn.

A lost port is ignored as long as the other one works.
"""

from __future__ import annotations

from collections.abc import Sequence

from quadrotor.errors import LinkError
from vehicle_link.serial.frames import Frame, FrameDecoder
from vehicle_link.serial.port import Port


class MicrocontrollerPorts:
    """One or two serial ports of a microcontroller.

    Args:
        failures: list that receives a line about each lost port, for the caller.

    Attributes:
        lost: number of lost ports.
    """

    def __init__(self, ports: Sequence[Port], failures: list[str]) -> None:
        if not 1 <= len(ports) <= 2:
            raise LinkError(f"{len(ports)} serial ports given; a microcontroller has one or two")
        self.lost = 0
        self._unsaid = ""  # why a port was lost, until the other one is known to work
        self._failures = failures
        self._ports = [(port, FrameDecoder(), index) for index, port in enumerate(ports)]
        self._damaged_before = 0  # on lost ports
        self._turn = 0

    @property
    def damaged(self) -> int:
        """Return the number of runs of bytes, on all ports, that are not frames."""
        return self._damaged_before + sum(decoder.damaged for _, decoder, _ in self._ports)

    def filenos(self) -> tuple[int, ...]:
        """Return the file descriptors for poll(). Raises LinkError for ports in memory."""
        return tuple(port.fileno() for port, _, _ in self._ports)

    def read(self) -> list[tuple[int, Frame]]:
        """Return the received frames, one port after the other, each with the index of its port.

        Raises LinkError when the last port is lost.
        """
        frames: list[tuple[int, Frame]] = []
        for port, decoder, index in tuple(self._ports):
            try:
                data = port.read()
            except LinkError as error:
                self._lose(port, error)
                continue
            if data:
                self._say_lost()
                frames += [(index, frame) for frame in decoder.feed(data)]
        return frames

    def write(self, frame: bytes, in_turn: bool = False) -> None:
        """Write on the first port, or on each in turn.

        Raises LinkError when the last port is lost.
        """
        while True:
            port = self._ports[self._turn % len(self._ports) if in_turn else 0][0]
            try:
                port.write(frame)
            except LinkError as error:
                self._lose(port, error)
                continue
            self._turn += in_turn
            return

    def _lose(self, port: Port, error: LinkError) -> None:
        """Drop a lost port. Raises LinkError when it was the last one."""
        if len(self._ports) == 1:
            if self._unsaid:  # both were lost at once
                raise LinkError(f"{self._unsaid}; {error}") from error
            raise error
        self.lost += 1
        self._damaged_before += next(d.damaged for p, d, _ in self._ports if p is port)
        self._ports = [other for other in self._ports if other[0] is not port]
        self._unsaid = str(error)

    def _say_lost(self) -> None:
        """Report a lost port once the other one has proved that it works."""
        if self._unsaid:
            line = f"{self._unsaid}; flying on with the other port, at half the rate"
            self._failures.append(line)
            self._unsaid = ""
