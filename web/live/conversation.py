"""Conversation on a page's websocket: send and receive at once until either side ends."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketDisconnected

GONE = (WebSocketDisconnect, WebSocketDisconnected, OSError)
"""Errors of a socket that the page has closed: at once, or when it is used again."""


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
