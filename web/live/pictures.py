"""`/ws/picture/{camera}`: a camera's pictures as they arrive, one JPEG a message.

A page opens it while it shows the picture. The topic is subscribed to while any page, program or
recording needs it, and the tracker process makes pictures only then. A page that does not keep up
skips to the newest picture.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Literal

from fastapi import FastAPI, WebSocket

from quadrotor.errors import LinkError, MeasurementError
from quadrotor.parameter_description import ParameterValue
from vehicle_link.topics.measurements import decode_picture
from web.live.conversation import converse
from web.live.forwarding import Forwarding

Camera = Literal["tracker", "tracker_2", "tracker_3", "tracker_4", "camera"]
"""The tracker's cameras, or the one on board."""


class PictureClient:
    """One page that shows a camera: a client of `web.live.forwarding`.

    Attributes:
        topics: the one that it subscribes to.
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
        """Ignore new values of parameters, which a picture does not show."""

    async def talk(self, socket: WebSocket) -> None:
        """Send each picture until the socket is closed."""
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


def add_pictures(app: FastAPI, forwarding: Forwarding) -> None:
    """Add the websocket /ws/picture/{camera}."""

    @app.websocket("/ws/picture/{camera}")
    async def picture(socket: WebSocket, camera: Camera) -> None:
        await socket.accept()
        client = PictureClient(camera)
        with forwarding.serving(client):
            await converse(socket, client.talk(socket))
