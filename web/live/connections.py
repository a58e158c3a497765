"""Connections of HTTP, of which only so many may wait for what the other end does not send.

Without a bound, a program that opens connections and sends nothing takes all file descriptors of
this process, and with them the emergency landing of every page.
"""

from __future__ import annotations

import socket
from asyncio import Transport
from contextlib import suppress
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

WAITING_MOST = 200
"""Connections without a whole request; a page keeps up to six open between its requests."""


class BoundedListener(socket.socket):
    """A listening socket; a new connection ends the oldest of too many before their TLS handshake.

    asyncio tells nobody of a connection until its handshake is done, or 60 s have passed.
    """

    def __init__(self, listening: socket.socket) -> None:
        super().__init__(fileno=listening.detach())
        self._unserved: dict[object, socket.socket] = {}

    def accept(self) -> tuple[socket.socket, object]:
        accepted, address = super().accept()
        open_ones = {at: one for at, one in self._unserved.items() if one.fileno() >= 0}
        self._unserved = open_ones | {address: accepted}
        if len(self._unserved) > WAITING_MOST:
            oldest = next(iter(self._unserved))
            with suppress(OSError):  # the other end has closed it
                self._unserved.pop(oldest).shutdown(socket.SHUT_RDWR)
        return accepted, address

    def serve(self, address: object) -> None:
        """Count the connection from this address as one that is served."""
        self._unserved.pop(address, None)


class BoundedConnection(H11Protocol):
    """The connection of uvicorn; a new one ends the oldest of too many that wait.

    Args:
        listener: the socket that has accepted it.
    """

    def __init__(self, *args: Any, listener: BoundedListener, **more: Any) -> None:
        super().__init__(*args, **more)
        self._listener = listener

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._listener.serve(transport.get_extra_info("peername"))
        self._began = self.loop.time()
        everyone = self.connections
        waiting = [one for one in everyone if isinstance(one, BoundedConnection) and one.is_waiting]
        if len(waiting) > WAITING_MOST:
            min(waiting, key=lambda one: one._began).transport.abort()

    @property
    def is_waiting(self) -> bool:
        """Return whether the next bytes are the other end's to send."""
        request = self.cycle
        is_idle = request is None or request.response_complete or request.more_body
        return is_idle and not self.transport.is_closing()
