"""The steps of a mission as behaviors: an optional take-off, up to twelve way-points in a row,
and an optional landing.

The way-points are flown as one path of least snap (follow_trajectory, waypoints), which the vehicle
checks as a whole before it begins.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from control.behaviors.way_points import COUNT_MAX
from extensions.mavlink.commands import world_point
from extensions.mavlink.dialect import MAVLink_message, mavlink
from extensions.mavlink.frames import Origin, Vector, swap_yaw
from quadrotor.errors import RefusedError

WAYPOINT, TAKE_OFF, LAND, SPEED = (
    mavlink.MAV_CMD_NAV_WAYPOINT,
    mavlink.MAV_CMD_NAV_TAKEOFF,
    mavlink.MAV_CMD_NAV_LAND,
    mavlink.MAV_CMD_DO_CHANGE_SPEED,
)


@dataclass(frozen=True, slots=True)
class Step:
    """One behavior of a mission; `points` are its way-points in the world, by item."""

    behavior: str
    arguments: dict[str, object]
    points: dict[int, Vector]


def steps_of(items: Sequence[MAVLink_message], origin: Origin) -> list[Step]:
    """Return the steps of MISSION_ITEM_INT messages. Raises RefusedError for items that cannot be
    flown.
    """
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


def _point(item: MAVLink_message, origin: Origin) -> Vector:
    if not math.isfinite(item.z):
        raise RefusedError(f"mission item {item.seq} has no altitude")
    return world_point(item.frame, 1e-7 * item.x, 1e-7 * item.y, item.z, origin)
