"""One serial line at its data rate: 115200 Bd 8N1 carries 11,520 bytes a second each way.

The host's bytes wait in its own buffer until the wire has carried them; the microcontroller's wait
in a small ring, and what exceeds it is lost, as on the chip.
"""

from __future__ import annotations

from collections.abc import Callable

from vehicle.simulator.pseudo_terminal import PseudoTerminal

BYTES_PER_SECOND = 115_200 // 10
"""Rate at ten bits per byte, with a start and a stop bit."""
BUFFER = 256
"""Size, in bytes, of the microcontroller's ring in either direction."""
_END = b"\r"


class Uart:
    """A `vehicle_link.serial.port.Port` with the delay of a real serial line.

    Only whole frames are delivered: a host's adapter also collects bytes, and a frame counts with
    its last byte.

    Attributes:
        overruns: number of bytes that the microcontroller could not queue.
        delivered: called with the bytes that the host can read from now on.
    """

    def __init__(self, terminal: PseudoTerminal) -> None:
        self.terminal = terminal
        self.overruns = 0
        self.delivered: Callable[[bytes], None] | None = None
        self._sending = bytearray()
        self._received = bytearray()
        self._out = self._in = 0.0  # bytes that the wire could have carried by now

    def advance(self, duration: float) -> None:
        """Let the wire carry for `duration` (s)."""
        carried = duration * BYTES_PER_SECOND
        if self._sending:
            self._out += carried
            end = self._sending.rfind(_END, 0, int(self._out)) + 1
            if end == 0 and len(self._sending) < int(self._out):  # not a frame: no end to wait for
                end = len(self._sending)
            if end:
                self._deliver(bytes(self._sending[:end]))
                del self._sending[:end]
                self._out -= end
        else:
            self._out = 0.0
        self._in = min(self._in + carried, carried + 1.0)
        room = min(int(self._in), BUFFER - len(self._received))
        if room > 0:
            data = self.terminal.read(room)
            self._received += data
            self._in -= len(data)

    def _deliver(self, data: bytes) -> None:
        dropped = self.terminal.dropped
        self.terminal.write(data)
        if self.delivered is not None and self.terminal.dropped == dropped:
            self.delivered(data)

    def read(self) -> bytes:
        """Return the bytes that have arrived at the microcontroller."""
        data = bytes(self._received)
        self._received.clear()
        return data

    def write(self, data: bytes) -> None:
        """Queue the bytes, completely or in part."""
        room = BUFFER - len(self._sending)
        self._sending += data[:room]
        self.overruns += max(0, len(data) - room)

    def unplug(self) -> None:
        self.terminal.unplug()

    def plug_in(self) -> None:
        self.terminal.plug_in()

    def fileno(self) -> int:
        return self.terminal.fileno()

    def close(self) -> None:
        self.terminal.close()
