"""Buffers of viser that are safe to write to from the web process's own thread.

Every write sets an `asyncio.Event` of viser's loop, from whichever thread, and an Event then
iterates over its waiters. When viser's loop changed these in the meantime, the write failed, and
with it the drawing of the 3D view. Here only viser's loop touches the waiters; viser itself wakes
it after each write.
"""

from __future__ import annotations

import asyncio
from typing import Any

from viser.infra import _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer


def make_writes_safe() -> None:
    """Give every viser server that this process creates from now on buffers that are safe for
    writing.
    """
    module: Any = _infra
    module.AsyncMessageBuffer = SafeBuffer


class SafeBuffer(AsyncMessageBuffer):
    """Buffer whose event wakes its waiters only on the buffer's own loop."""

    def __init__(self, event_loop: asyncio.AbstractEventLoop, persistent_messages: bool) -> None:
        super().__init__(event_loop, persistent_messages, message_event=_Wake(event_loop))


class _Wake(asyncio.Event):
    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        super().__init__()
        self._owner = loop
        self._is_wanted = False  # a `set` elsewhere: for `is_set`, not for waiters

    def is_set(self) -> bool:
        return self._is_wanted or super().is_set()

    def set(self) -> None:
        self._is_wanted = True
        if asyncio._get_running_loop() is self._owner:
            super().set()

    def clear(self) -> None:
        self._is_wanted = False
        super().clear()

    async def wait(self) -> bool:  # type: ignore[override]
        return True if self.is_set() else await super().wait()
