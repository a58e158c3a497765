"""Conversations end without an error when the page leaves, whichever side notices it."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from starlette.websockets import WebSocket

from web.live.conversation import converse


def socket_that_breaks() -> WebSocket:
    """Return an accepted socket of a page that leaves while something is sent to it."""
    arrived = ["websocket.connect"]

    async def receive() -> Any:
        if not arrived:
            await asyncio.Event().wait()  # nothing more arrives
        return {"type": arrived.pop()}

    async def send(message: Any) -> None:
        if message["type"] == "websocket.send":
            raise OSError("the page has left")

    return WebSocket({"type": "websocket"}, receive, send)


def test_a_page_that_leaves_while_both_sides_send_to_it_is_no_error() -> None:
    socket = socket_that_breaks()

    async def say() -> None:
        await socket.send_text("a")

    async def run() -> None:
        await socket.accept()
        await converse(socket, say(), say())

    asyncio.run(run())


def test_another_error_is_raised() -> None:
    socket = socket_that_breaks()

    async def fail() -> None:
        raise RuntimeError("a mistake of ours")

    async def run() -> None:
        await socket.accept()
        await converse(socket, fail())

    with pytest.raises(RuntimeError, match="a mistake of ours"):
        asyncio.run(run())
