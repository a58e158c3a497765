"""`/ws/picture/{camera}`: a camera's pictures as they come, one JPEG a message.

A page opens it while it shows the picture. The topic is taken from the hub while some page, program
or a recording does, and the tracker process makes pictures for these alone. A page that does not
keep up skips to the newest picture.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

from fastapi import FastAPI, WebSocket

from quadrotor.errors import LinkError, MeasurementError
from quadrotor.parameters import ParameterValue
from vehicle_link.topics import decode_picture
from web.live.conversation import converse

if TYPE_CHECKING:
    from web.app_parts import Parts

Camera = Literal["tracker", "camera"]
"""Of the tracker, or on board."""


class PictureClient:
    """One page that looks at a camera: a client of `web.live.forwarding`.

    Attributes:
        topics: the one that it takes.
    """

    def __init__(self, camera: Camera) -> None:
        self.topics = frozenset({f"{camera}_picture"})
        self._newest: bytes | None = None
        self._news = asyncio.Event()

    def put(self, topic: str, received_ns: int, payload: bytes) -> None:
        if topic in self.topics:
            self._newest = payload

    def wake(self) -> None:
        if self._newest is not None:
            self._news.set()

    def changed(self, values: Mapping[str, ParameterValue]) -> None:
        """Take news of parameters, of which a picture shows none."""

    async def talk(self, socket: WebSocket) -> None:
        """Send each picture until the socket is gone."""
        while True:
            await self._news.wait()
            self._news.clear()
            payload, self._newest = self._newest, None
            if payload is None:
                continue
            try:
                jpeg = decode_picture(payload)
            except (LinkError, MeasurementError) as error:
                await socket.send_text(str(error))
            else:
                await socket.send_bytes(jpeg)


def add_pictures(app: FastAPI, parts: Parts) -> None:
    """Add the websocket."""

    @app.websocket("/ws/picture/{camera}")
    async def picture(socket: WebSocket, camera: Camera) -> None:
        await socket.accept()
        client = PictureClient(camera)
        with parts.forwarding.serving(client):
            await converse(socket, client.talk(socket))
