"""Missions: upload and download of way-points, and their flight as behaviors.

A mission is an optional take-off, up to twelve way-points in a row, and an optional landing. The
way-points are flown as one path of least snap (follow_trajectory, waypoints), which the vehicle
checks as a whole before it begins.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from control.behaviors.way_points import COUNT_MAX
from quadlab.mavlink.commands import world_point
from quadlab.mavlink.dialect import mavlink
from quadlab.mavlink.frames import Origin, Vector, swap_yaw
from quadlab.mavlink.link import Peer
from quadlab.mavlink.vehicle import Vehicle
from quadrotor.errors import RefusedError

ITEMS_MOST = 2 * COUNT_MAX + 2
ASKED_AGAIN, TRIES = 0.5, 6
"""Seconds after which an item is asked for again, and how often before an upload is given up."""
SEEN_WITHIN = 2.0
"""Seconds after its acceptance in which the status must show a behavior."""
REACHED = 0.25
"""Distance, in m, at which a way-point counts as reached."""
WAYPOINT, TAKE_OFF, LAND, SPEED = (
    mavlink.MAV_CMD_NAV_WAYPOINT,
    mavlink.MAV_CMD_NAV_TAKEOFF,
    mavlink.MAV_CMD_NAV_LAND,
    mavlink.MAV_CMD_DO_CHANGE_SPEED,
)
ENDS = {"take_off": "hover", "follow_trajectory": "hover", "land": "ground"}
"""The behavior that follows each one when it has ended well."""


@dataclass(frozen=True, slots=True)
class Step:
    """One behavior of a mission; `points` are its way-points in the world, by item."""

    behavior: str
    arguments: dict[str, Any]
    points: dict[int, Vector]


def steps_of(items: Sequence[Any], origin: Origin) -> list[Step]:
    """Return what MISSION_ITEM_INT messages ask for. Raises RefusedError for what is not flown."""
    steps: list[Step] = []
    words: list[str] = []
    points: dict[int, Vector] = {}
    speed: dict[str, float] = {}
    for item in items:
        if steps and steps[-1].behavior == "land":
            raise RefusedError(f"mission item {item.seq} follows the landing")
        if item.command == SPEED:
            speed = {"speed": item.param2} if item.param2 > 0.0 else {}
        elif item.command == WAYPOINT:
            points[item.seq] = point = _point(item, origin)
            yaw = swap_yaw(math.radians(item.param4)) if math.isfinite(item.param4) else None
            words.append(
                " ".join(f"{one:.3f}" for one in (*point, *(() if yaw is None else (yaw,))))
            )
        elif item.command == TAKE_OFF and not words and not steps:
            height = _point(item, origin)[2]
            steps.append(Step("take_off", {"height": height}, {item.seq: (0.0, 0.0, height)}))
        elif item.command == LAND:
            if words:
                steps.append(_path(words, points, speed))
            steps.append(Step("land", {}, {item.seq: (0.0, 0.0, 0.0)}))
            words, points = [], {}
        else:
            raise RefusedError(
                f"mission item {item.seq}: command {item.command} is not flown there; there are "
                "way-points, a take-off in front, a landing at the end, and speeds"
            )
    return [*steps, _path(words, points, speed)] if words else steps


def _path(words: list[str], points: dict[int, Vector], speed: dict[str, float]) -> Step:
    if len(words) > COUNT_MAX:
        raise RefusedError(f"a mission of {len(words)} way-points; {COUNT_MAX} are flown")
    arguments = {"trajectory": "waypoints", "waypoints": "; ".join(words), **speed}
    return Step("follow_trajectory", arguments, points)


def _point(item: Any, origin: Origin) -> Vector:
    if not math.isfinite(item.z):
        raise RefusedError(f"mission item {item.seq} has no altitude")
    return world_point(item.frame, 1e-7 * item.x, 1e-7 * item.y, item.z, origin)


class Missions:
    """The stored mission, and the upload under way.

    Args:
        may_upload: returns why a ground station may not upload, or "".
        say: tells a ground station a line, and prints it.
    """

    def __init__(
        self, origin: Origin, may_upload: Callable[[Peer], str], say: Callable[[Peer, str], None]
    ) -> None:
        self._origin, self._may_upload, self._say = origin, may_upload, say
        self.items: tuple[Any, ...] = ()
        self.steps: list[Step] = []
        self._from: Peer | None = None
        self._count, self._arrived, self._asked, self._tries = 0, list[Any](), 0.0, 0

    def take(self, peer: Peer, message: Any, now: float) -> None:
        """Take a message of the mission protocol; `now` in s of a steady clock."""
        kind = message.get_type()
        if kind == "MISSION_ACK":
            return
        if getattr(message, "mission_type", 0) != mavlink.MAV_MISSION_TYPE_MISSION:
            if kind == "MISSION_REQUEST_LIST":
                peer.send(self._count_message(peer, 0, message.mission_type))
            else:
                self._acknowledge(peer, mavlink.MAV_MISSION_UNSUPPORTED, message.mission_type)
        elif kind == "MISSION_REQUEST_LIST":
            peer.send(self._count_message(peer, len(self.items), 0))
        elif kind in ("MISSION_REQUEST_INT", "MISSION_REQUEST"):
            self._send_item(peer, message.seq)
        elif kind == "MISSION_COUNT":
            self._begin(peer, message.count, now)
        elif kind == "MISSION_ITEM_INT":
            self._add(peer, message, now)
        elif kind == "MISSION_CLEAR_ALL":
            if self._is_allowed(peer):
                self.items, self.steps = (), []
                self._acknowledge(peer, mavlink.MAV_MISSION_ACCEPTED)
        else:
            self._acknowledge(peer, mavlink.MAV_MISSION_UNSUPPORTED)

    def tick(self, now: float) -> None:
        """Ask again for an item that has not come, or give the upload up."""
        peer = self._from
        if peer is None or now - self._asked < ASKED_AGAIN:
            return
        if self._tries >= TRIES:
            self._from = None
            self._acknowledge(peer, mavlink.MAV_MISSION_OPERATION_CANCELLED)
            self._say(peer, f"mission upload given up at item {len(self._arrived)}: nothing came")
        else:
            self._ask(now)

    def _begin(self, peer: Peer, count: int, now: float) -> None:
        if not self._is_allowed(peer):
            return
        if self._from not in (None, peer):
            self._refuse(
                peer, "another ground station uploads a mission", mavlink.MAV_MISSION_DENIED
            )
            return
        if not 1 <= count <= ITEMS_MOST:
            line = f"a mission of {count} items; allowed are 1 to {ITEMS_MOST}"
            self._refuse(peer, line, mavlink.MAV_MISSION_NO_SPACE)
            return
        self._from, self._count, self._arrived, self._tries = peer, count, [], 0
        self._ask(now)

    def _add(self, peer: Peer, item: Any, now: float) -> None:
        if peer is not self._from or item.seq != len(self._arrived):
            return  # repeated, or late
        self._arrived.append(item)
        self._tries = 0
        if len(self._arrived) < self._count:
            self._ask(now)
            return
        self._from = None
        try:
            self.steps = steps_of(self._arrived, self._origin)
        except RefusedError as error:
            self._refuse(peer, str(error), mavlink.MAV_MISSION_UNSUPPORTED)
            return
        self.items = tuple(self._arrived)
        self._acknowledge(peer, mavlink.MAV_MISSION_ACCEPTED)

    def _ask(self, now: float) -> None:
        assert self._from is not None
        self._asked, self._tries = now, self._tries + 1
        self._from.send(
            mavlink.MAVLink_mission_request_int_message(
                self._from.system, 0, len(self._arrived), mavlink.MAV_MISSION_TYPE_MISSION
            )
        )

    def _send_item(self, peer: Peer, seq: int) -> None:
        if not 0 <= seq < len(self.items):
            self._acknowledge(peer, mavlink.MAV_MISSION_INVALID_SEQUENCE)
            return
        one = self.items[seq]
        numbers = (one.param1, one.param2, one.param3, one.param4, one.x, one.y, one.z)
        peer.send(
            mavlink.MAVLink_mission_item_int_message(
                *(peer.system, 0, seq, one.frame, one.command, int(seq == 0), one.autocontinue),
                *numbers,
                mavlink.MAV_MISSION_TYPE_MISSION,
            )
        )

    def _is_allowed(self, peer: Peer) -> bool:
        if reason := self._may_upload(peer):
            self._refuse(peer, reason, mavlink.MAV_MISSION_DENIED)
        return not reason

    def _refuse(self, peer: Peer, line: str, result: int) -> None:
        self._acknowledge(peer, result)
        self._say(peer, f"mission refused: {line}")

    def _acknowledge(self, peer: Peer, result: int, kind: int = 0) -> None:
        peer.send(mavlink.MAVLink_mission_ack_message(peer.system, 0, result, kind))

    def _count_message(self, peer: Peer, count: int, kind: int) -> Any:
        return mavlink.MAVLink_mission_count_message(peer.system, 0, count, kind)


class MissionFlight:
    """A mission that is being flown, one behavior after the other.

    Args:
        ask: (behavior, arguments, then) asks the vehicle; `then` gets the reason of a refusal, ""
            if there is none.
        tell: sends all ground stations a message.
        say: tells the one that flies it a line.
    """

    def __init__(
        self,
        who: str,
        steps: Sequence[Step],
        vehicle: Vehicle,
        ask: Callable[[str, dict[str, Any], Callable[[str], None]], None],
        tell: Callable[[Any], None],
        say: Callable[[str], None],
    ) -> None:
        self.who, self._steps, self._vehicle = who, list(steps), vehicle
        self._ask, self._tell, self._say = ask, tell, say
        self._is_asked = self._is_seen = False
        self._accepted: float | None = None
        self._left: dict[int, Vector] = {}
        self.is_over = False

    def begin(self, then: Callable[[str], None]) -> None:
        """Start the first step; `then` gets the reason of a refusal, or ""."""

        def begun(reason: str) -> None:
            self.is_over = bool(reason)
            then(reason)

        self._start(begun)

    def tick(self, now: float) -> None:
        """Look at what the vehicle does, and start the next step when one has ended."""
        if self.is_over or not self._is_asked:
            return
        if self._accepted is None:
            self._accepted = now
        step, behavior = self._steps[0], self._vehicle.behavior
        if behavior == step.behavior:
            self._is_seen = True
            self._note_reached()
        elif self._is_seen and behavior == ENDS[step.behavior]:
            self._note_reached(everything=True)
            self._steps.pop(0)
            if not self._steps:
                self.end("mission flown")
            else:
                self._start(self._go_on)
        elif self._is_seen or now - self._accepted > SEEN_WITHIN:
            self.end(f"mission ended: the vehicle does {behavior or 'not answer'}")

    def end(self, line: str) -> None:
        """End it where it is: the present behavior is flown to its end."""
        if not self.is_over:
            self.is_over = True
            self._say(line)

    def _start(self, then: Callable[[str], None]) -> None:
        step = self._steps[0]
        self._is_asked = self._is_seen = False

        def answered(reason: str) -> None:
            self._is_asked, self._accepted = not reason, None
            self._left = dict(step.points)
            self._tell_current()
            then(reason)

        self._ask(step.behavior, step.arguments, answered)

    def _go_on(self, reason: str) -> None:
        if reason:
            self.end(f"mission ended: {reason}")

    def _note_reached(self, everything: bool = False) -> None:
        motion = self._vehicle.motion
        for seq, point in list(self._left.items()):
            is_near = motion is not None and math.dist(point, motion.position_w) < REACHED
            if not (everything or (is_near and self._steps[0].behavior == "follow_trajectory")):
                return
            del self._left[seq]
            self._tell(mavlink.MAVLink_mission_item_reached_message(seq))
            self._tell_current()

    def _tell_current(self) -> None:
        if self._left:
            self._tell(mavlink.MAVLink_mission_current_message(next(iter(self._left))))
