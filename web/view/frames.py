"""Frames of viser, packed once for all pages that get the same.

viser packs every change again for each of its clients; with ten pages that was a third of the web
process. Pages that keep up get the same messages at the same time, so the newest packed frame is
stored and sent to each of them. A page that lags gets separate frames, with the newest values, as
viser intends. The packing itself is done by viser.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import AsyncGenerator, Sequence
from operator import is_
from typing import TYPE_CHECKING, Any

from viser.infra import _infra

if TYPE_CHECKING:
    from viser.infra._async_message_buffer import AsyncMessageBuffer
    from viser.infra._messages import Message

    Window = Sequence[Message]

_viser_producer = _infra._message_producer


def share_frames() -> None:
    """Share frames in every viser server of this process.

    viser looks up its producer for each new client.
    """
    _infra._message_producer = _produce


class _Newest(threading.local):
    """Newest packed frame; each viser server has its own thread."""

    window: Window = ()
    frame: bytes = b""

    async def of(self, window: Window) -> bytes:
        # Compare identities: to compare equal messages would take a comparison array by array.
        if len(window) != len(self.window) or not all(map(is_, window, self.window)):
            self.frame, self.window = await _packed(window), window
        return self.frame


_newest = _Newest()


async def _produce(
    websocket: Any,
    buffer: AsyncMessageBuffer,
    client_id: int,
    backlog_done_message: Message | None = None,
) -> None:
    """Send a client all messages that are in `buffer` or will be, until either ends."""
    if not buffer.persistent_messages:  # for this client alone: its camera
        await _viser_producer(websocket, buffer, client_id, backlog_done_message)
        return
    windows = buffer.window_generator(client_id, backlog_done_message=backlog_done_message)
    async with contextlib.aclosing(windows):
        async for window in windows:
            await websocket.send(await _newest.of(window))


async def _packed(window: Window) -> bytes:
    once = _Once(window)
    await _viser_producer(once, once, 0)  # type: ignore[arg-type]
    return once.frame


class _Once:
    """Buffer and websocket for viser's producer, which yields one window and stores its frame."""

    done = False
    frame = b""

    def __init__(self, window: Window) -> None:
        self._window = window

    async def window_generator(self, *_: object, **__: object) -> AsyncGenerator[Window]:
        yield self._window

    async def send(self, frame: bytes) -> None:
        self.frame = frame
