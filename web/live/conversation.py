"""Conversation on a page's websocket: send and receive at once until either side ends."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Coroutine
from typing import Any

import msgspec
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketDisconnected

GONE = (WebSocketDisconnect, WebSocketDisconnected, OSError)
"""Errors of a socket that the page has closed: at once, or when it is used again."""

_encode = msgspec.json.Encoder().encode


async def send_json(socket: WebSocket, message: object) -> None:
    await socket.send_text(_encode(message).decode())


def significant(value: float, digits: int = 6) -> float | None:
    """Return a number with so many digits, or None if it is not finite, which JSON lacks."""
    return float(f"{value:.{digits}g}") if math.isfinite(value) else None


async def converse(
    socket: WebSocket,
    talk: Coroutine[Any, Any, None],
    listen: Coroutine[Any, Any, None] | None = None,
) -> None:
    """Run both until one of them ends, then end the other; a closed socket is no error.

    Args:
        talk: sends to the page.
        listen: reads until the page disconnects; without it, what the page sends is dropped.

    Raises what either of them raises.
    """
    both = [asyncio.create_task(one) for one in (listen or _wait_for_end(socket), talk)]
    try:
        await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in both:
            task.cancel()
        ended = await asyncio.gather(*both, return_exceptions=True)
    for error in ended:
        if isinstance(error, Exception) and not isinstance(error, GONE):
            raise error


async def _wait_for_end(socket: WebSocket) -> None:
    while (await socket.receive())["type"] != "websocket.disconnect":
        pass
