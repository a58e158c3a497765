"""Drags and clicks in the 3D view, and the beacons that are dragged in it.

viser never receives a drag or a click: the pump removes those of an operator from the browser's
messages (`drag_of`, `click_of`) and passes them to whoever shows the handle. For a beacon the
pointer's line of sight is intersected with the beacons' plane, so that it stays in it whatever the
view. Positions are passed on at 10 Hz, always including the last one. A handle moves only with the
confirmed layout.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container
from dataclasses import dataclass
from typing import Literal, NamedTuple

import msgspec

from web.view.shapes import Point, on_plane

MESSAGE = "SceneNodeDragMessage"
PERIOD = 0.1  # s between two positions of one beacon
SETTLING = 1.5  # s for which a requested position is shown without a confirmation
NEAR = 0.002  # m; a confirmed position this close to the requested one is the same
FARTHEST = 15.0  # m from the world's origin, on each axis

Phase = Literal["start", "update", "end"]


class Drag(NamedTuple):
    """One step of a drag: the pointer's place (m, world) as seen from `eye`, the camera."""

    name: str
    phase: Phase
    pointer: Point
    eye: Point
    who: str


class Click(NamedTuple):
    """A click beside all handles: a line of sight from `eye` (m, world) through `through`."""

    eye: Point
    through: Point
    who: str


class _DragMessage(msgspec.Struct, tag_field="type", tag=MESSAGE):
    """Drag message of viser's client; its other fields are not needed."""

    phase: Phase
    name: str
    end_position: Point
    button: Literal["left"]
    owner: Literal[""] = ""


class _ClickMessage(msgspec.Struct, tag_field="type", tag="ScenePointerMessage"):
    """Click message of viser's client; its other fields are not needed."""

    event_type: Literal["click"]
    ray_origin: Point
    ray_direction: Point


_decode = msgspec.msgpack.Decoder(_DragMessage).decode
_decode_click = msgspec.msgpack.Decoder(_ClickMessage).decode


def click_of(frame: bytes, who: str) -> Click | None:
    """Return a browser's message as a click in the scene; None for any other message."""
    try:
        message = _decode_click(frame)
    except msgspec.DecodeError:
        return None
    eye, ray = message.ray_origin, message.ray_direction
    if not all(map(math.isfinite, (*eye, *ray))):
        return None
    x, y, z = (e + r for e, r in zip(eye, ray, strict=True))
    return Click(eye, (x, y, z), who)


def drag_of(frame: bytes, names: Container[str], eye: Point | None, who: str) -> Drag | None:
    """Return a browser's message as a drag of one of these nodes; None for any other message."""
    try:
        message = _decode(frame)
    except msgspec.DecodeError:
        return None
    if (
        eye is None
        or message.name not in names
        or not all(map(math.isfinite, message.end_position))
    ):
        return None
    return Drag(message.name, message.phase, message.end_position, eye, who)


@dataclass(slots=True)
class _Request:
    """Requested position of a beacon, and whether it was sent on."""

    position: Point
    who: str
    at: float  # s, of the newest step
    is_sent: bool = True
    is_over: bool = False


class BeaconDrags:
    """Tracker of drags by beacon id; `on_moved(id, position, who)` is called with the positions."""

    def __init__(self) -> None:
        self.on_moved: Callable[[int, Point, str], None] = lambda *_: None
        self._offsets: dict[int, Point] = {}
        self._requests: dict[int, _Request] = {}
        self._sent: dict[int, float] = {}

    def take(self, drag: Drag, id: int, place: Point, normal: Point, now: float) -> None:
        """Handle one step of beacon `id`, which is at `place` in the plane with this normal."""
        met = on_plane(drag.eye, drag.pointer, place, normal)
        if drag.phase == "start":
            self._offsets.pop(id, None)
            if met is not None:
                x, y, z = (p - m for p, m in zip(place, met, strict=True))
                self._offsets[id] = (x, y, z)
                self._requests[id] = _Request(place, drag.who, now)
            return
        offset = self._offsets.get(id)
        if offset is None:
            return
        request = self._requests.setdefault(id, _Request(place, drag.who, now))
        request.at = now
        if met is not None and max(map(abs, met)) < FARTHEST:
            x, y, z = (m + o for m, o in zip(met, offset, strict=True))
            if math.dist((x, y, z), request.position) > 1e-4:
                request.position, request.is_sent = (x, y, z), False
        if drag.phase == "end":
            request.is_over = True
            del self._offsets[id]

    def pass_on(self, now: float) -> None:
        """Pass on the moves that are due; to be called at every frame."""
        for id, request in list(self._requests.items()):
            if not request.is_sent and now - self._sent.get(id, -math.inf) >= PERIOD:
                request.is_sent = True
                self._sent[id] = now
                self.on_moved(id, request.position, request.who)

    def wanted(self, places: dict[int, Point], now: float) -> dict[int, Point]:
        """Return the requested places that are not yet confirmed; `places` are the confirmed."""
        for id, request in list(self._requests.items()):
            place = places.get(id)
            is_confirmed = request.is_over and place is not None and _near(place, request.position)
            if request.is_sent and (is_confirmed or place is None or now - request.at > SETTLING):
                del self._requests[id]
        return {
            id: request.position
            for id, request in self._requests.items()
            if id in places and not _near(places[id], request.position)
        }

    def forget(self) -> None:
        """Drop refused requests; a drag under way continues."""
        self._requests.clear()

    def stop(self) -> None:
        """End every drag."""
        self._requests.clear()
        self._offsets.clear()


def _near(a: Point, b: Point) -> bool:
    return math.dist(a, b) < NEAR
