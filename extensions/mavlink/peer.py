"""One ground station: its parser, its budget, and what is sent to it."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from contextlib import suppress

from extensions.mavlink.dialect import MAVLink_message, mavlink
from quadrotor.errors import StorageError

SYSTEM, COMPONENT = 1, 1
BYTES_A_SECOND = 60_000
"""Bytes parsed of one ground station in a second; also the longest burst."""
AT_LEAST = 40
"""Bytes that a datagram counts at least."""
AT_ONCE = 20
"""Messages of a list or a log that are sent in one turn."""
UNSENT_MOST = 1 << 16
"""Bytes that wait for a ground station on TCP that reads too slowly; messages beyond are lost."""
MARKERS = (mavlink.PROTOCOL_MARKER_V1, mavlink.PROTOCOL_MARKER_V2)
"""First bytes of a message."""
GONE = 5.0
"""Seconds of silence after which a ground station has left."""
SAID_AGAIN = 60.0
"""Seconds after which the same complaint about a ground station is printed again."""
SAID_MOST = 20
"""Maximum number of complaints about a ground station in that time."""
TENS_OF_MICROSECONDS, SIGNING_EPOCH = 100_000, 1_420_070_400  # 1 January 2015

Address = tuple[str, int]


class _Signed(mavlink.MAVLink):  # type: ignore[misc]  # of an untyped package
    """pymavlink's parser, in which a forged signature does not set the time of its stream."""

    def check_signature(self, data: bytearray, system: int, component: int) -> bool:
        times, key = self.signing.stream_timestamps, (data[-13], system, component)
        before = times.get(key)
        if super().check_signature(data, system, component):
            return True
        times.pop(key, None)
        if before is not None:
            times[key] = before
        return False


class Peer:
    """One ground station: an address that sends MAVLink, or to which it is sent.

    Attributes:
        is_stream: whether it has a connection of its own (TCP).
        may_command: whether it signs, is named on the command line, or everybody may command.
        has_begun: whether something that begins as MAVLink has come.
        system: source system of its first message, which it keeps; 0 before that.
        heard: when its newest message came, s of the computer's steady clock.
        due: when each message is due that is sent periodically, by its id; `period` in s.
        shown: what its newest heartbeat contained.
        waiting: messages to send as time allows, each sequence to its end.
    """

    def __init__(self, sock: socket.socket, address: Address, key: bytes, is_fixed: bool) -> None:
        self.socket, self.address, self.is_fixed = sock, address, is_fixed
        self.is_stream = sock.type == socket.SOCK_STREAM
        self.may_command, self.has_begun = is_fixed or bool(key), False
        self._unsent = bytearray()
        self.mav = _Signed(self, SYSTEM, COMPONENT)
        self.mav.robust_parsing = True
        if key:
            signing = self.mav.signing
            signing.secret_key, signing.sign_outgoing = key, True
            signing.timestamp = int((time.time() - SIGNING_EPOCH) * TENS_OF_MICROSECONDS)
        self.system, self.heard = 0, time.monotonic() if self.is_stream else -GONE
        self.due: dict[int, float] = {}
        self.shown: object = None
        self.period: dict[int, float] = {}
        self.waiting: dict[str, Iterator[MAVLink_message]] = {}
        self._budget, self._filled = float(BYTES_A_SECOND), time.monotonic()
        self._said: dict[str, float] = {}

    @property
    def name(self) -> str:
        """Return the name under which it commands."""
        return f"mavlink {self.system} at {self.address[0]}:{self.address[1]}"

    def send(self, message: MAVLink_message) -> None:
        """Send a message; it is lost when nobody receives there, as on any datagram link."""
        self.mav.send(message)

    def write(self, data: bytes) -> None:
        """Send the bytes of one message, for pymavlink."""
        with suppress(OSError):
            if not self.is_stream:
                self.socket.sendto(data, self.address)
                return
            if len(self._unsent) < UNSENT_MOST:
                self._unsent += data
            del self._unsent[: self.socket.send(self._unsent)]

    def send_waiting(self) -> list[str]:
        """Send some messages of each sequence; return why sequences ended before their end."""
        failed = []
        for name, messages in list(self.waiting.items()):
            try:
                for _ in range(AT_ONCE):
                    self.send(next(messages))
            except StopIteration:
                del self.waiting[name]
            except StorageError as error:
                del self.waiting[name]
                failed.append(str(error))
        return failed

    def may_parse(self, size: int, now: float) -> bool:
        """Return whether a datagram of `size` bytes is within what it may send."""
        gained = (now - self._filled) * BYTES_A_SECOND
        self._budget, self._filled = min(self._budget + gained, float(BYTES_A_SECOND)), now
        if self._budget < AT_LEAST:
            return False
        self._budget -= max(size, AT_LEAST)
        return True

    def begins(self, data: bytes) -> bool:
        """Return whether the first bytes of a connection, or each datagram, begin as MAVLink does.

        The parser would also find a message behind the head of a browser's request.
        """
        if not (self.is_stream and self.has_begun):
            self.has_begun = data[0] in MARKERS
        return self.has_begun

    def parse(self, data: bytes) -> list[MAVLink_message]:
        """Return the messages in some bytes; of a datagram, nothing is kept for the next one."""
        messages = self.mav.parse_buffer(data) or []
        if not self.is_stream:
            self.mav.buf, self.mav.buf_index = bytearray(), 0
        return list(messages)

    def is_new(self, kind: str, now: float) -> bool:
        """Return whether to print a complaint: one of its kind, and SAID_MOST in all, a minute."""
        self._said = {one: at for one, at in self._said.items() if now - at < SAID_AGAIN}
        if is_new := kind not in self._said and len(self._said) < SAID_MOST:
            self._said[kind] = now
        return is_new
