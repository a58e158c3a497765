"""Route of the live connection, `/foxglove`, and those of the links to it."""

from __future__ import annotations

import asyncio
import time
import uuid
from collections.abc import Coroutine
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlencode, urlsplit

from fastapi import FastAPI, Request, WebSocket
from fastapi.responses import JSONResponse, Response

from extensions.foxglove import protocol, services
from extensions.foxglove.catalogue import CALLED, channels
from extensions.foxglove.catalogue import services as offered
from extensions.foxglove.client import FoxgloveClient
from extensions.foxglove.protocol import SUBPROTOCOLS, Asked, Call
from quadrotor.errors import LinkError, QuadlabError, RefusedError
from quadrotor.json_object import JsonObject
from web.access.requester import Asker
from web.access.roles import Role, Session
from web.access.sign_in_tokens import LINK_AGE
from web.feature import Feature
from web.live.conversation import converse
from web.runs.sharing import VIEWERS

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext

AT_ONCE = 8  # calls of one client in progress
LAYOUT = Path(__file__).with_name("layout.json")
INSTANCE = uuid.uuid4().hex
"""Identity of this process, by which a client recognises a restart."""


def add_foxglove(app: FastAPI, context: VehicleContext) -> None:
    """Add the websocket, and the routes below /api/foxglove."""

    @app.websocket("/foxglove")
    async def live(socket: WebSocket) -> None:
        await serve(socket, context)

    @app.post("/api/foxglove/link")
    def link(request: Request, session: Asker) -> JsonObject:
        """Return the address of the live connection, with a token that is valid for ten minutes.

        A program with this token connects as you. `viewers` are addresses that open the connection
        in a viewer; these can only watch, because a viewer's server sees its own address, including
        the token.
        """
        scheme = "wss" if urlsplit(context.base_url).scheme == "https" else "ws"
        place = f"{scheme}://{request.headers['host']}/v/{context.vehicle}/foxglove"

        def address(holder: Session) -> str:
            return f"{place}?{urlencode({'token': context.people.tokens.sign_link(holder)})}"

        watching = address(replace(session, role=Role.VIEWER))
        query = urlencode({"ds": "foxglove-websocket", "ds.url": watching})
        return {
            "url": address(session),
            "expires": time.time() + LINK_AGE,
            "viewers": {name: f"{page}?{query}" for name, page in VIEWERS.items()},
        }

    @app.get("/api/foxglove/layout")
    def layout() -> Response:
        """Return a layout with this vehicle's topics, to import into a viewer."""
        content = LAYOUT.read_text().replace("VEHICLE", context.vehicle)
        disposition = f'attachment; filename="quadlab_{context.vehicle}_layout.json"'
        headers = {"content-disposition": disposition}
        return Response(content, media_type="application/json", headers=headers)


async def serve(socket: WebSocket, context: VehicleContext) -> None:
    """Serve one client until the connection or its session ends."""
    chosen = next((name for name in SUBPROTOCOLS if name in socket.scope["subprotocols"]), None)
    if chosen is None:
        asked = ", ".join(socket.scope["subprotocols"]) or "none"
        line = f"subprotocol {asked:.80}; allowed are {' and '.join(SUBPROTOCOLS)}"
        await socket.send_denial_response(JSONResponse({"error": line}, 400))
        return
    await socket.accept(chosen)
    client = FoxgloveClient(socket, socket.scope["session"], context.vehicle)
    conversation = _Conversation(client, context)
    client.tell(
        protocol.text(
            "serverInfo",
            name=f"quadlab {context.vehicle}",
            capabilities=["parameters", "parametersSubscribe", "services"],
            supportedEncodings=[protocol.ENCODING],
            metadata={"ROS_DISTRO": "jazzy"},
            sessionId=INSTANCE,
        )
    )
    client.tell(protocol.text("advertise", channels=channels(context.vehicle)))
    client.tell(protocol.text("advertiseServices", services=offered(context.vehicle)))
    with context.forwarding.serving(client):
        await converse(socket, client.talk(), conversation.listen(socket))


class _Conversation:
    """Requests of one client."""

    def __init__(self, client: FoxgloveClient, context: VehicleContext) -> None:
        self._client, self._context = client, context
        self._tasks: set[asyncio.Task[None]] = set()

    async def listen(self, socket: WebSocket) -> None:
        while (event := await socket.receive())["type"] != "websocket.disconnect":
            try:
                if (text := event.get("text")) is not None:
                    self._asked(protocol.parse_text(text))
                else:
                    self._called(protocol.parse_call(event["bytes"]))
            except ValueError as error:
                self._client.refuse(error)

    def _asked(self, asked: Asked) -> None:
        """Handle a request. Raises ValueError."""
        client, replica = self._client, self._context.replica
        match asked:
            case protocol.Subscribe():
                for one in asked.subscriptions:
                    client.subscribe(one.id, one.channelId)
            case protocol.Unsubscribe():
                for number in asked.subscriptionIds:
                    client.unsubscribe(number)
            case protocol.GetParameters():
                self._values(asked.parameterNames, asked.id)
            case protocol.FollowParameters():
                client.follow(asked.parameterNames)
            case protocol.LeaveParameters():
                client.leave(asked.parameterNames, replica.values())
            case protocol.SetParameters():
                self._begin(self._set(asked))

    def _values(self, names: list[str], identity: str | None) -> None:
        values = self._context.replica.values()
        found = {name: values[name] for name in names or values if name in values}
        self._client.tell(protocol.parameter_values(found, identity))

    async def _set(self, asked: protocol.SetParameters) -> None:
        session = self._client.session
        values = {one.name: one.value for one in asked.parameters}
        try:
            if not session.role.may(Role.OPERATOR):
                raise RefusedError(f"{session.label} may watch but not change parameters")
            await self._context.gains.change(values, session.label)
        except QuadlabError as error:
            self._client.refuse(error)
        self._values(list(values), asked.id)  # also after a refusal: what is in force

    def _called(self, call: Call) -> None:
        if not 0 <= call.service < len(CALLED):
            raise ValueError(f"there is no service {call.service}; allowed 0 to {len(CALLED) - 1}")
        self._begin(self._call(call))

    async def _call(self, call: Call) -> None:
        session = self._client.session
        try:
            payload = await services.call(
                self._context, session, CALLED[call.service], call.payload
            )
        except LinkError as error:
            fields = {"serviceId": call.service, "callId": call.id, "message": str(error)}
            self._client.tell(protocol.text("serviceCallFailure", **fields))
        else:
            self._client.tell(protocol.answer_frame(call, payload))

    def _begin(self, work: Coroutine[object, object, None]) -> None:
        """Run a request in parallel. Raises ValueError if too many are in progress."""
        if len(self._tasks) >= AT_ONCE:
            work.close()
            raise ValueError(f"{AT_ONCE} requests are under way; wait for their answers")
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


FEATURE = Feature(add_foxglove)
