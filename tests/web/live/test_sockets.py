"""A websocket that has ended is a page that has left, not an error of the server."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from typing import Any

import httpx
import pytest
import websockets.exceptions
from uvicorn.protocols.utils import ClientDisconnected

from web.live.sockets import FLOODED, LiveWebSocket

FLOODS: dict[str, Callable[[Any], object]] = {
    "texts": lambda socket: socket.send("{}"),
    "bytes": lambda socket: socket.send(b""),
    "pings": lambda socket: socket.ping(),
    "pieces": lambda socket: socket.send([""] * 50),
}


@pytest.mark.parametrize("message", [{"text": "{}"}, {"bytes": b"1"}, {"frames": [b"1"]}])
@pytest.mark.parametrize("ended", ["close_sent", "disconnected"])
def test_what_is_sent_after_the_end_finds_the_page_gone(
    message: dict[str, Any], ended: str
) -> None:
    async def send() -> None:
        connection: Any = LiveWebSocket.__new__(LiveWebSocket)
        connection.writable = asyncio.Event()
        connection.writable.set()
        connection.handshake_complete, connection.initial_response = True, None
        connection.close_sent = connection.disconnected = False
        setattr(connection, ended, True)
        await connection.send({"type": "websocket.send", **message})

    with pytest.raises(ClientDisconnected):
        asyncio.run(send())


@pytest.mark.parametrize("flood", FLOODS)
def test_a_page_that_floods_its_socket_is_closed(
    site: Any, viewer: httpx.Client, flood: str
) -> None:
    with site.websocket("/ws/events", site.cookie(viewer)) as other:
        with (
            site.websocket("/ws/events", site.cookie(viewer)) as socket,
            contextlib.suppress(websockets.exceptions.ConnectionClosed),
        ):
            for _ in range(100_000):
                FLOODS[flood](socket)
        assert (socket.close_code, socket.close_reason) == (1008, FLOODED)
        other.recv(timeout=10.0)
