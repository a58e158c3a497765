"""Open websockets, which are closed when their session ends."""

from __future__ import annotations

import asyncio
import contextlib

from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from quadrotor.errors import StorageError
from web.access.roles import Session
from web.access.sessions import Sessions

PERIOD = 0.5  # s, between checks for sessions ended by another process or by age
GRACE = 1.0  # s that a socket has to end by itself
MOST = 120
"""Open websockets of one session; a page has six."""
SIGNED_OUT = 4401
"""Close code on which the page opens the sign-in page instead of reconnecting."""


class OpenSockets:
    """The open websockets of one event loop."""

    def __init__(self, sessions: Sessions) -> None:
        self._sessions = sessions
        self._guards: set[_Guard] = set()

    @property
    def labels(self) -> set[str]:
        """Return the names of the people who have a page open."""
        return {guard.session.label for guard in self._guards if not guard.is_over}

    async def serve(
        self, app: ASGIApp, session: Session, scope: Scope, receive: Receive, send: Send
    ) -> None:
        """Run `app` for one websocket until either side or the session ends.

        Refuse it if the session has MOST already, as each holds a file descriptor.
        """
        if sum(one.session.id == session.id for one in self._guards) >= MOST:
            why = f"{session.label} has {MOST} connections open; close some pages"
            await WebSocketClose(1008, why)(scope, receive, send)
            return
        guard = _Guard(session, receive, send)
        self._guards.add(guard)
        try:
            await app(scope, guard.receive, guard.send)
        except asyncio.CancelledError:
            if not guard.cut_off():
                raise
        finally:
            self._guards.discard(guard)
            guard.close()

    def check(self) -> None:
        """Close the sockets whose session is over."""
        for guard in list(self._guards):
            if not guard.is_over and not self._sessions.holds(guard.session):
                guard.end()

    async def run(self) -> None:
        while True:
            await asyncio.sleep(PERIOD)
            with contextlib.suppress(StorageError):  # tried again; requests report the error
                self.check()


class _Guard:
    """Guard between one socket and its application; once it is over, nothing passes any more."""

    def __init__(self, session: Session, receive: Receive, send: Send) -> None:
        self.session = session
        self.is_over = False
        self._receive = receive
        self._send = send
        self._serving = asyncio.current_task()
        self._closing: asyncio.Task[None] | None = None
        self._deadline: asyncio.TimerHandle | None = None
        self._was_cut_off = False

    async def receive(self) -> Message:
        message: Message = {"type": "websocket.disconnect", "code": SIGNED_OUT}
        if not self.is_over:
            came = await self._receive()
            if not self.is_over:  # a frame received in the meantime does not count either
                message = dict(came)
        return message

    async def send(self, message: Message) -> None:
        if self.is_over:
            raise OSError("signed out")  # what a closed socket raises
        await self._send(message)

    def end(self) -> None:
        """End the socket.

        The close frame wakes the application; after GRACE its task is cancelled.
        """
        self.is_over = True
        loop = asyncio.get_running_loop()
        self._closing = loop.create_task(self._close_frame())
        self._deadline = loop.call_later(GRACE, self._cut_off)

    def cut_off(self) -> bool:
        """Return whether this guard cancelled the task; then revoke the cancellation."""
        if self._was_cut_off and self._serving is not None:
            self._serving.uncancel()
        return self._was_cut_off

    def close(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()

    async def _close_frame(self) -> None:
        close = {"type": "websocket.close", "code": SIGNED_OUT, "reason": "signed out"}
        with contextlib.suppress(OSError, RuntimeError):
            await self._send(close)

    def _cut_off(self) -> None:
        self._was_cut_off = True
        if self._closing is not None:
            self._closing.cancel()
        if self._serving is not None:
            self._serving.cancel()
