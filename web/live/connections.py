"""Connections of HTTP, of which only so many may wait for what the other end does not send.

Without a bound, a program that opens connections and sends nothing takes all file descriptors of
this process, and with them the emergency landing of every page.
"""

from __future__ import annotations

from asyncio import Transport

from uvicorn.protocols.http.h11_impl import H11Protocol

WAITING_MOST = 200
"""Connections without a whole request; a page keeps up to six open between its requests."""


class BoundedConnection(H11Protocol):
    """The connection of uvicorn; a new one ends the oldest of too many that wait."""

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
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
