"""The draft: what an operator prepares in the 3D view before it is commanded, `/api/draft`.

One draft at a time is shown to all pages; whoever opened it moves it. It is judged while it moves,
by the same survey with which the vehicle accepts or refuses a trajectory. Nothing here commands the
vehicle: the page sends `start_behavior`, or for a flight volume the parameters, when its button is
pressed.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Any

from fastapi import FastAPI
from pydantic import Field

from quadrotor.errors import OutOfBoundsError, QuadlabError, RefusedError
from web.beacons.shapes import Point
from web.body import Body
from web.commands.trajectories import Arguments, TrajectoryMonitor
from web.live.events import Message
from web.requester import Operator
from web.view.draft import MOST, Draft, DraftView, Kind, is_sound, text_of
from web.view.lines import Box

PERIOD = 0.05  # s between two judgements while it is dragged
AGAIN = 0.5  # s between two looks at where the vehicle is
AHEAD = 0.5  # m in front of the vehicle, where a point starts
OLD = 30.0  # s after which the same path is drawn again, before the 3D view takes it away


class DraftBody(Body):
    kind: Kind
    points: list[Point] | None = Field(
        None,
        min_length=1,
        max_length=MOST,
        description="m, world; of a volume the lowest and the highest corner; left out: where the "
        "vehicle is, or the present volume",
    )
    arguments: Arguments = Field(
        default_factory=dict, description="of follow_trajectory, for a trajectory"
    )


class Drafts:
    """The draft of one vehicle. Use it from the event loop only.

    Args:
        volume: returns the flight volume, None while it is not known.
    """

    def __init__(
        self,
        view: DraftView,
        monitor: TrajectoryMonitor,
        publish: Callable[[Message], None],
        volume: Callable[[], Box | None],
    ) -> None:
        self._view, self._monitor, self._publish, self._volume = view, monitor, publish, volume
        self._draft: Draft | None = None
        self._found: dict[str, Any] = {}
        self._changed = asyncio.Event()
        view.on_edit = self._edit

    def open(self, body: DraftBody, by: str) -> dict[str, Any] | None:
        """Open a draft in place of the one there. Raises OutOfBoundsError or RefusedError."""
        points = tuple(body.points) if body.points else self._start(body.kind)
        if not is_sound(points) or (body.kind == "volume" and len(points) != 2):
            raise OutOfBoundsError("a draft's points are within 15 m of the origin; a volume has 2")
        self._edit(Draft(body.kind, points, by, body.arguments))
        self._tell()
        return self.summary()

    def close(self, *, flown: bool = False) -> None:
        """Take the draft away; the path of one that is now flown stays."""
        self._draft, self._found = None, {}
        self._view.show(None)
        if not flown:
            self._monitor.forget()
        self._tell()

    def summary(self) -> dict[str, Any] | None:
        """Return the draft and what was found of it, None without one.

        `checked` is whether `refusal`, `duration` (s) and `speed` (m/s) are of these points; `away`
        is the distance (m) from the vehicle's hover to the first point.
        """
        draft = self._draft
        if draft is None:
            return None
        away = math.dist(self._monitor.here[:3], draft.points[0])
        shown = {"kind": draft.kind, "points": draft.points, "by": draft.by}
        return {**shown, "arguments": draft.arguments, "away": round(away, 2), **self._found}

    async def run(self) -> None:
        """Judge the draft whenever it, or the vehicle's place, has changed."""
        loop = asyncio.get_running_loop()
        judged, due = None, 0.0
        while True:
            try:
                async with asyncio.timeout(AGAIN if self._draft else None):
                    await self._changed.wait()
            except TimeoutError:
                pass
            self._changed.clear()
            if (draft := self._draft) is None:
                judged = None
                continue
            key = (draft, tuple(round(c, 2) for c in self._monitor.here))
            if self._found.get("checked") and key == judged and loop.time() < due:
                continue
            found = await self._judge(draft)
            if draft is self._draft:
                judged, due = key, loop.time() + OLD
                self._found = {**found, "checked": True}
                self._view.show(draft, not found["refusal"])
                self._tell()
            elif self._draft is None:  # closed meanwhile
                self._monitor.forget()
            await asyncio.sleep(PERIOD)

    async def _judge(self, draft: Draft) -> dict[str, Any]:
        """Return the demands of a draft and why the vehicle would refuse it, "" if it would not."""
        x, y, z = draft.points[0]
        start = None
        if draft.kind == "volume":
            self._monitor.forget()
            return {"refusal": "", "duration": None, "speed": None}
        if draft.kind == "target":
            arguments: Arguments = {"trajectory": "line", "x": x, "y": y, "z": z}
        elif draft.kind == "waypoints":
            arguments = {"trajectory": "waypoints", "waypoints": text_of(draft.points)}
        else:
            arguments, start = draft.arguments, (x, y, z, self._monitor.here[3])
        try:
            return await self._monitor.preview(arguments, start)
        except QuadlabError as error:
            return {"refusal": str(error), "duration": None, "speed": None}

    def _edit(self, draft: Draft) -> None:
        self._draft = draft
        self._found = {**self._found, "checked": False} if self._found else {"checked": False}
        self._view.show(draft, not self._found.get("refusal"))
        self._changed.set()

    def _start(self, kind: Kind) -> tuple[Point, ...]:
        if kind != "volume":
            x, y, z, yaw = self._monitor.here
            if kind != "trajectory":
                x, y = x + AHEAD * math.cos(yaw), y + AHEAD * math.sin(yaw)
            return ((round(x, 2), round(y, 2), round(z, 2)),)
        if (box := self._volume()) is None:
            raise RefusedError("the flight volume has not been read from the vehicle yet")
        (x0, x1), (y0, y1), (z0, z1) = box
        return ((x0, y0, z0), (x1, y1, z1))

    def _tell(self) -> None:
        self._publish({"type": "draft", "draft": self.summary()})


def add_drafts(app: FastAPI, drafts: Drafts) -> None:
    @app.put("/api/draft")
    async def open_draft(body: DraftBody, session: Operator) -> dict[str, Any]:
        """Open a draft in the 3D view, in place of the one there; the caller's pages may move it.

        The events `draft` of /ws/events tell what becomes of it. It commands nothing.
        """
        return {"draft": drafts.open(body, session.label)}

    @app.delete("/api/draft")
    async def close_draft(_: Operator, flown: bool = False) -> dict[str, Any]:
        """Take the draft away; the path of one that is now `flown` stays."""
        drafts.close(flown=flown)
        return {"draft": None}
