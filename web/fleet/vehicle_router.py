"""Routing of requests to vehicles: `/v/quad2/…` is for quad2, all others for the first one.

It is a plain ASGI application behind the gate. Each vehicle has a complete application, as if it
were the only one, so that the same permissions apply under every address.
"""

from __future__ import annotations

from collections.abc import Mapping
from urllib.parse import quote

from fastapi import FastAPI
from starlette.responses import JSONResponse, RedirectResponse
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocketClose

PLACE = "/v/"


class VehicleRouter:
    """ASGI application that passes each request to the application of its vehicle.

    Args:
        apps: the applications by name; the lifespan is that of the first one.
    """

    def __init__(self, apps: Mapping[str, FastAPI]) -> None:
        self.apps = dict(apps)
        self._first = next(iter(self.apps.values()))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        path = scope.get("path", "")
        if not path.startswith(PLACE):
            await self._first(scope, receive, send)
            return
        name, slash, rest = path.removeprefix(PLACE).partition("/")
        app = self.apps.get(name)
        if app is None:
            await self._unknown(name, scope, receive, send)
        elif not slash and scope["type"] == "http":
            await RedirectResponse(f"{PLACE}{name}/")(scope, receive, send)
        else:
            within = {"path": f"/{rest}", "raw_path": quote(f"/{rest}").encode()}
            await app({**scope, **within}, receive, send)

    async def _unknown(self, name: str, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await WebSocketClose(1008, "no such vehicle")(scope, receive, send)
            return
        there = ", ".join(self.apps)
        line = f"there is no vehicle {name!r:.40} here; there are {there}"
        await JSONResponse({"error": line}, 404)(scope, receive, send)
