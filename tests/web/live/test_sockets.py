"""A websocket that has ended is a page that has left, not an error of the server."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from uvicorn.protocols.utils import ClientDisconnected

from web.live.sockets import LiveWebSocket


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
