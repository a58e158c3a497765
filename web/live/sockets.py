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

SEND_BUFFER = 16 * 1024  # bytes; the kernel doubles it
UNSENT = 8 * 1024  # bytes


class LiveWebSocket(WebSocketsSansIOProtocol):
    """The websocket of uvicorn with small send buffers."""

    def connection_made(self, transport: BaseTransport) -> None:
        super().connection_made(transport)
        connection = transport.get_extra_info("socket")
        if connection is not None:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
            lowat = getattr(socket, "TCP_NOTSENT_LOWAT", None)
            if lowat is not None:
                connection.setsockopt(socket.IPPROTO_TCP, lowat, UNSENT)
        self.transport.set_write_buffer_limits(high=UNSENT)
        if (below := plain_transport(self.transport)) is not None:
            below.set_write_buffer_limits(high=UNSENT)

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


def listen(host: str, port: int) -> socket.socket:
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
    return made
