"""The listening port, and websocket connections without a backlog for a stalled tab.

Everything sent live has a newer version a moment later. With the usual buffers (megabytes in
the kernel) a tab that was stalled replays half a minute; with small ones `send` waits, and the
next message sent is the newest.
"""

from __future__ import annotations

import errno
import socket
from asyncio import BaseTransport
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from uvicorn.protocols.utils import ClientDisconnected
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

if TYPE_CHECKING:
    from uvicorn._types import ASGISendEvent

from quadrotor.errors import LinkError, UsageError
from web.live.connections import BoundedListener

SEND_BUFFER = 16 * 1024  # bytes; the kernel doubles it
UNSENT = 8 * 1024  # bytes
RATE, BURST = 200.0, 400.0
"""Frames a second of one page, and at once. A page sends its sticks and the camera of its view 50
times a second each, on sockets of their own."""
SLICE = 2048
"""Bytes parsed before the number of frames is looked at: a frame may have 6."""
FLOODED = f"more than {RATE:.0f} messages a second"
POLICY_VIOLATION = 1008  # close code
LINGERING = 1.0
"""Time, in s, in which a flood is dropped unread, so that its sender gets the reason."""


class LiveWebSocket(WebSocketsSansIOProtocol):
    """The websocket of uvicorn with small send buffers, which ends where a page floods it.

    Frames are counted before they reach an application, those without one (pings) too.
    """

    _is_flooded = False

    def connection_made(self, transport: BaseTransport) -> None:
        super().connection_made(transport)
        self._left, self._counted = BURST, self.loop.time()
        connection = transport.get_extra_info("socket")
        if connection is not None:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
            lowat = getattr(socket, "TCP_NOTSENT_LOWAT", None)
            if lowat is not None:
                connection.setsockopt(socket.IPPROTO_TCP, lowat, UNSENT)
        self.transport.set_write_buffer_limits(high=UNSENT)
        if (below := plain_transport(self.transport)) is not None:
            below.set_write_buffer_limits(high=UNSENT)

    def data_received(self, data: bytes) -> None:
        for start in range(0, len(data), SLICE):
            if self._is_flooded or self.transport.is_closing():
                return
            super().data_received(data[start : start + SLICE])

    def handle_events(self) -> None:
        """Limit the rate by a bucket that RATE fills and each frame empties by one."""
        now = self.loop.time()
        self._left = min(BURST, self._left + RATE * (now - self._counted))
        self._left, self._counted = self._left - len(self.conn.events), now
        if self._left >= 0.0:
            super().handle_events()
            return
        self._is_flooded = self.close_sent = True
        self.stop_keepalive()
        self.conn.fail(POLICY_VIOLATION, FLOODED)
        self.transport.write(b"".join(self.conn.data_to_send()))
        self.queue.put_nowait(
            {"type": "websocket.disconnect", "code": POLICY_VIOLATION, "reason": FLOODED}
        )
        if self.read_paused:
            self.read_paused = False
            self.transport.resume_reading()
        self.close_timer = self.loop.call_later(LINGERING, self.transport.close)

    async def send(self, message: ASGISendEvent) -> None:
        if message["type"] == "websocket.send":
            await self.writable.wait()
            # uvicorn itself also closes it, when a page has not answered its pings.
            if self.disconnected or self.close_sent:
                raise ClientDisconnected
        frames: Sequence[bytes] | None = message.get("frames")  # type: ignore[assignment]
        if frames is not None:  # binary messages in one write: each alone costs ten times as much
            for frame in frames:
                self.conn.send_binary(frame)
            self.transport.write(b"".join(self.conn.data_to_send()))
            return
        await super().send(message)
        if message["type"] == "websocket.http.response.body" and not message.get("more_body"):
            # The gate refused with an answer: uvicorn would log that as a failure.
            self.handshake_complete = True


def plain_transport(transport: Any) -> Any:
    """Return the transport below TLS, or None.

    It has a buffer of its own, to which asyncio offers no other access.
    """
    return getattr(getattr(transport, "_ssl_protocol", None), "_transport", None)


def listen(host: str, port: int) -> BoundedListener:
    """Open a listening socket. Raises LinkError or UsageError, one line each."""
    if not 0 <= port <= 65535:
        raise UsageError(f"port {port} is not a port; allowed 0 (any free one) to 65535")
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        both = host == "::"
        made = socket.create_server((host, port), family=family, backlog=128, dualstack_ipv6=both)
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise LinkError(
                f"port {port} is taken, perhaps by another quadlab; "
                f"stop that one or choose another with --port {port + 1}"
            ) from error
        if error.errno == errno.EACCES:
            raise UsageError(
                f"port {port} needs root; choose one above 1023 with --port"
            ) from error
        raise LinkError(f"cannot listen on {host}:{port} ({error.strerror or error})") from error
    # Connections inherit it. asyncio sets it only if the protocol is named, and without it the
    # second half of each answer waits 40 ms for the acknowledgement of the first.
    made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return BoundedListener(made)
