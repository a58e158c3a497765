"""A UDP socket that never makes its sender wait, with a thread that receives."""

from __future__ import annotations

import contextlib
import logging
import select
import socket
import threading
from collections.abc import Callable
from typing import Any

from vehicle_link import defects
from vehicle_link.lane.datagram import LARGEST

log = logging.getLogger(__name__)

LOW_DELAY = 46 << 2  # DSCP EF; on WiFi the queue for video
PRIORITY = 6  # in the machine's own queues
SEND_BUFFER = 16_384
"""Bytes; when the radio accepts nothing, 0.1 s of telemetry waits, not 2 s."""
Address = Any
"""A socket address in the form of the socket's family."""


class LaneSocket:
    """The UDP socket at one end of a lane.

    Attributes:
        port: its local port.
    """

    def __init__(self, family: int, host: str, port: int) -> None:
        """Raise OSError when the port is in use or there is no such address."""
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError:
            self._socket.close()
            raise
        self._socket.setblocking(False)
        self.port: int = self._socket.getsockname()[1]
        self._wake, self._woken = socket.socketpair()
        self._thread: threading.Thread | None = None
        for level, option, value in (
            (socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER),
            (socket.SOL_SOCKET, socket.SO_PRIORITY, PRIORITY),
            (socket.IPPROTO_IP, socket.IP_TOS, LOW_DELAY),
            (socket.IPPROTO_IPV6, socket.IPV6_TCLASS, LOW_DELAY),
        ):
            with contextlib.suppress(OSError):  # best effort: not all systems allow it
                self._socket.setsockopt(level, option, value)

    def send(self, datagram: bytes, address: Address) -> bool:
        """Send at once or not at all; return whether it was sent. Thread-safe."""
        try:
            self._socket.sendto(datagram, address)
        except OSError:  # the buffer is full, or there is no route at the moment
            return False
        return True

    def start(self, handle: Callable[[bytes, Address], None]) -> None:
        """Call `handle` with every datagram, cut at LARGEST + 1 bytes, in a thread."""
        self._thread = threading.Thread(target=self._run, args=(handle,), name="lane", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._wake.close()
        if self._thread is not None:
            self._thread.join(1.0)
        self._socket.close()
        self._woken.close()

    def _run(self, handle: Callable[[bytes, Address], None]) -> None:
        poll = select.poll()
        poll.register(self._socket, select.POLLIN)
        poll.register(self._woken, select.POLLIN)
        closed = self._woken.fileno()
        while all(descriptor != closed for descriptor, _ in poll.poll()):
            try:
                datagram, address = self._socket.recvfrom(LARGEST + 1)
            except OSError:  # an ICMP error for something sent, or a spurious wake-up
                continue
            try:
                handle(datagram, address)
            except MemoryError as error:
                defects.report(error)
            except Exception:
                log.exception("a datagram could not be handled")
