"""The draft: what an operator prepares in the 3D view before it is commanded, `/api/draft`.

One draft at a time is shown to all pages; whoever opened it moves it. It is judged while it moves,
by the same survey with which the vehicle accepts or refuses a trajectory. Nothing here commands the
vehicle: the page sends `start_behavior`, or for a volume or a box the parameters, when its button
is pressed.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Any

from fastapi import FastAPI
from pydantic import Field

from control.behaviors.parameters import flight_volume, keep_out
from control.keep_out import MOST as LARGEST_NUMBER
from control.keep_out import PARAMETER, KeepOutBox, check_around, format_keep_out, parse_keep_out
from quadrotor.errors import OutOfBoundsError, QuadlabError, RefusedError
from web.access.requester import Operator
from web.body import Body
from web.commands.trajectories import Arguments, TrajectoryMonitor
from web.live.events import Message
from web.view.draft import MOST, Draft, DraftView, Kind, is_sound, text_of
from web.view.server import ViewServer
from web.view.shapes import Point

PERIOD = 0.05  # s between two judgements while it is dragged
AGAIN = 0.5  # s between two looks at where the vehicle is
SIDE = 0.25  # m, half of a new box
AHEAD = 0.5  # m in front of the vehicle, where a point starts
OLD = 30.0  # s after which the same path is drawn again, before the 3D view takes it away


class DraftBody(Body):
    kind: Kind
    points: list[Point] | None = Field(
        None,
        min_length=1,
        max_length=MOST,
        description="m, world; of a volume or box the lowest and the highest corner; left out: "
        "where the vehicle is, or the present volume or box",
    )
    arguments: Arguments = Field(
        default_factory=dict,
        description="of follow_trajectory, for a trajectory; `box`, its name, for a keep-out box",
    )


class Drafts:
    """The draft of one vehicle. Use it from the event loop only.

    Args:
        value: returns a parameter's value, None while it is not known.
    """

    def __init__(
        self,
        server: ViewServer,
        monitor: TrajectoryMonitor,
        publish: Callable[[Message], None],
        value: Callable[[str], Any],
    ) -> None:
        self._view = DraftView(server, self._edit)
        self._monitor, self._publish, self._value = monitor, publish, value
        self._draft: Draft | None = None
        self._found: dict[str, Any] = {}
        self._changed = asyncio.Event()

    def open(self, body: DraftBody, by: str) -> dict[str, Any] | None:
        """Open a draft in place of the one there. Raises OutOfBoundsError or RefusedError."""
        arguments = body.arguments
        if body.kind == "keep_out":
            arguments = {"box": str(arguments.get("box") or self._free_name())}
        points = tuple(body.points) if body.points else self._start(body.kind, arguments)
        draft = Draft(body.kind, points, by, arguments)
        if not is_sound(points) or (draft.is_box and len(points) != 2):
            raise OutOfBoundsError("a draft's points are within 15 m of the origin; a box has 2")
        self._edit(draft)
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
        """Return the draft with its findings, None without a draft.

        `checked` is whether `refusal`, `duration` (s) and `speed` (m/s) are of these points; `away`
        is the distance (m) from the vehicle's hover to the first point. Of a volume or box,
        `values` are the parameters to set; of a box, `removal` those without it, null where it is
        new, and `boxes` the names of those there are.
        """
        draft = self._draft
        if draft is None:
            return None
        away = math.dist(self._monitor.here[:3], draft.points[0])
        shown = {"kind": draft.kind, "points": draft.points, "by": draft.by}
        told = {"arguments": draft.arguments, "away": round(away, 2), **self._parameters(draft)}
        return {**shown, **told, **self._found}

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
        if draft.is_box:
            self._monitor.forget()
            return {"refusal": self._misplaced(draft), "duration": None, "speed": None}
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

    def _start(self, kind: Kind, arguments: Arguments) -> tuple[Point, ...]:
        x, y, z, yaw = self._monitor.here
        if kind == "keep_out":
            boxes = keep_out(self._value)
            if box := next((one for one in boxes if one.name == arguments["box"]), None):
                return (box.low_w, box.high_w)
            ahead = 2.0 * AHEAD + self._margin
            middle = x + ahead * math.cos(yaw), y + ahead * math.sin(yaw)
            (x0, y0), (x1, y1) = ([round(c + s, 2) for c in middle] for s in (-SIDE, SIDE))
            return ((x0, y0, 0.0), (x1, y1, 1.0))
        if kind != "volume":
            if kind != "trajectory":
                x, y = x + AHEAD * math.cos(yaw), y + AHEAD * math.sin(yaw)
            return ((round(x, 2), round(y, 2), round(z, 2)),)
        if (volume := flight_volume(self._value)) is None:
            raise RefusedError("the flight volume has not been read from the vehicle yet")
        (x0, x1), (y0, y1), (z0, z1) = volume
        return ((x0, y0, z0), (x1, y1, z1))

    @property
    def _margin(self) -> float:
        return float(self._value("behavior.keep_out_margin") or 0.0)

    def _free_name(self) -> str:
        """Return a name for one more box, the last one's where there may be no more."""
        names = [box.name for box in keep_out(self._value)]
        if len(names) == LARGEST_NUMBER:
            return names[-1]
        return next(name for k in range(1, 10) if (name := f"box_{k}") not in names)

    def _parameters(self, draft: Draft) -> dict[str, Any]:
        """Return the parameters that the draft's buttons set; nothing of a draft that flies."""
        if draft.kind == "volume":
            corners = zip(("min", "max"), draft.points, strict=True)
            walls = {
                f"behavior.volume_{axis}_{end}": c
                for end, corner in corners
                for axis, c in zip("xyz", corner, strict=True)
            }
            return {"values": walls}
        if draft.kind != "keep_out":
            return {}
        present, drafted = keep_out(self._value), self._box(draft)
        others = [box for box in present if box.name != drafted.name]
        return {
            "values": {PARAMETER: format_keep_out([*others, drafted])},
            "removal": {PARAMETER: format_keep_out(others)} if len(others) < len(present) else None,
            "boxes": [box.name for box in present],
        }

    def _box(self, draft: Draft) -> KeepOutBox:
        return KeepOutBox(str(draft.arguments["box"]), *draft.points)

    def _misplaced(self, draft: Draft) -> str:
        """Return why the vehicle would refuse a box here; "" for a volume."""
        if draft.kind == "volume":
            return ""
        x, y, z, _ = self._monitor.here
        way = ((x, y, z if self._monitor.is_airborne else 0.0), (x, y, z))
        try:
            boxes = parse_keep_out(self._parameters(draft)["values"][PARAMETER])
            check_around(boxes, self._margin, keep_out(self._value), self._margin, way)
        except QuadlabError as error:
            return str(error)
        return ""

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
