"""The routes of the formation of all vehicles of the page: `/api/formation` and two websockets.

`/formation` sends the formation as JSON ten times a second. To `/formation/sticks` a page sends the
frames of `web.commands.sticks` at 50 Hz while its dead-man button is held, each followed by a
float32: grow, -1 to 1. Each frame is answered as there. The vehicles of the formation get their
sticks by the same way as from the sticks of a page, so that control, watchdogs and time-outs hold
for each of them.
"""

from __future__ import annotations

import asyncio
import struct
import time
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from fastapi import FastAPI, WebSocket
from pydantic import Field

from extensions.formations.live.service import AT_LEAST, Formations, Hand
from quadrotor.errors import UsageError
from quadrotor.json_object import JsonObject
from quadrotor.plain_rotations import roll_pitch_yaw
from web.access.people import People
from web.access.requester import Operator
from web.access.roles import Role, Session
from web.body import Body
from web.commands.sticks import DeadManSwitch, Frame, read_frame
from web.feature import Feature
from web.live.conversation import converse, send_json

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext

PERIOD = 0.1
"""s between two pictures of the formation."""
_GROW = struct.Struct("<f")
_ANSWERS = 20
_of_pages: WeakKeyDictionary[People, Formations] = WeakKeyDictionary()


class FormationBody(Body):
    """Change of the formation; omitted fields keep their values."""

    desired: str | None = Field(None, max_length=4000, description="as `experiment.desired`")
    speed: float | None = Field(None, ge=0.0, le=1.0, description="m/s at full stick")
    yaw_rate: float | None = Field(None, ge=0.0, le=1.0, description="rad/s at full stick")
    scale_rate: float | None = Field(None, ge=0.0, le=0.3, description="1/s at full stick")


def add_formation(app: FastAPI, context: VehicleContext) -> None:
    """Add the routes for one vehicle; all vehicles of the page share a formation."""
    formations = _of_pages.setdefault(context.people, Formations())
    formations.add(context)

    @app.get("/api/formation")
    def formation() -> JsonObject:
        """Return the desired formation, the motions of full sticks, and how many make one."""
        return described(formations)

    @app.put("/api/formation")
    async def change(body: FormationBody, _: Operator) -> JsonObject:
        """Change the desired formation or the motions of full sticks, while nobody steers."""
        changed = formations.options.model_copy(update=body.model_dump(exclude_none=True))
        formations.change(changed)
        return described(formations)

    @app.websocket("/formation")
    async def show(socket: WebSocket) -> None:
        if await _opened(socket, formations):
            with formations.watched():
                await converse(socket, talk_of(socket, formations))

    @app.websocket("/formation/sticks")
    async def steer(socket: WebSocket) -> None:
        session: Session = socket.scope["session"]
        if not session.role.may(Role.OPERATOR):
            await socket.close(1008, "viewers cannot use the sticks; ask an operator")
        elif await _opened(socket, formations):
            with formations.watched():
                await Steering(formations, session).serve(socket)


FEATURE = Feature(add_formation)


def described(formations: Formations) -> JsonObject:
    """Return the options of the formation that people change, for the page."""
    p = formations.options
    own = {name: getattr(p, name) for name in FormationBody.model_fields}
    return {**own, "vehicles": formations.names, "least": AT_LEAST}


def picture(formations: Formations) -> JsonObject:
    """Return the formation as it is: x, y, z (m, W) and yaw (rad) of each vehicle, errors of edges
    (deg), rigidity eigenvalue with its bound, who steers, and lines.
    """
    squad = formations.squad
    poses = []
    for one in squad.members:
        yaw = roll_pitch_yaw(*one.pose.quaternion_wb)[2]
        where = [round(value, 3) for value in (*one.pose.position_w, yaw)]
        poses.append(where if one.pose.stamp_ns else None)
    return {
        "poses": poses,
        "flying": squad.flying,
        "edges": [[i, j, round(error, 2)] for (i, j), error in squad.errors.items()],
        "eigenvalue": round(squad.eigenvalue, 4),
        "bound": formations.options.eigenvalue_min,
        "holder": formations.holder,
        "lines": formations.lines,
    }


async def talk_of(socket: WebSocket, formations: Formations) -> None:
    """Send the formation until the page is gone."""
    while True:
        await send_json(socket, picture(formations))
        await asyncio.sleep(PERIOD)


async def _opened(socket: WebSocket, formations: Formations) -> bool:
    """Accept a socket; return whether it stays open, as it does where a formation can fly."""
    await socket.accept()
    try:
        return bool(formations.squad.names)
    except UsageError as error:
        await socket.close(1008, str(error))
        return False


class Steering:
    """The frames of one page."""

    def __init__(self, formations: Formations, session: Session) -> None:
        self._formations, self._label = formations, session.label
        self._answers: asyncio.Queue[JsonObject] = asyncio.Queue()
        self._switch, self._hand = DeadManSwitch(), Hand(session.label, self._dropped)

    async def serve(self, socket: WebSocket) -> None:
        """Take frames and answer them until the page is gone; closes it for anything else."""
        try:
            await converse(socket, self._talk(socket), self._listen(socket))
        except ValueError as error:
            await socket.close(1008, str(error))
        finally:
            self._formations.release(self._hand, "the page closed" if self._switch.on else "")

    async def _talk(self, socket: WebSocket) -> None:
        while True:
            await send_json(socket, await self._answers.get())

    async def _listen(self, socket: WebSocket) -> None:
        while (event := await socket.receive())["type"] != "websocket.disconnect":
            self.take(event.get("bytes") or b"")

    def take(self, raw: bytes) -> None:
        """Handle one frame. Raises ValueError for anything else."""
        if len(raw) < _GROW.size:
            raise ValueError(f"{len(raw)} bytes; a frame of the formation's sticks has 32")
        frame = read_frame(raw[: -_GROW.size])
        (grow,) = _GROW.unpack(raw[-_GROW.size :])
        if not abs(grow) <= 1.0:
            raise ValueError(f"grow is -1 to 1, not {grow}")
        now, was_on = time.monotonic(), self._switch.on
        is_on = self._switch.take(frame, now)
        if is_on and not was_on and (why := self._formations.refusal(self._label)):
            self._switch.refuse(why)
        elif is_on:
            if not was_on:
                self._hand.since = now
                self._formations.steer(self._hand)
            self._hand.axes, self._hand.at = (*frame.axes, grow), now
        if not self._switch.on:
            self._formations.release(self._hand)
        self._answer(frame)

    def _answer(self, frame: Frame) -> None:
        while self._answers.qsize() >= _ANSWERS:
            self._answers.get_nowait()
        on, why = self._switch.on, self._switch.why
        self._answers.put_nowait({"n": frame.number, "by": "web", "on": on, "why": why})

    def _dropped(self, why: str) -> None:
        """Wait for the button to be released, as the vehicles are not steered any more."""
        self._switch.refuse(why)
