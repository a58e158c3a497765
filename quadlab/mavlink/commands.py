"""MAVLink's commands as ours: what each asks the station for."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from quadlab.mavlink.dialect import mavlink
from quadlab.mavlink.frames import Origin, Place, swap_yaw
from quadlab.mavlink.modes import behavior_of
from quadrotor.errors import RefusedError

FORCED = 21196
"""Second number of a disarming that also stops motors in flight, by MAVLink's definition."""
TAKE_OFF_HEIGHT = 1.0
RELATIVE = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
ABSOLUTE = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a command asks for: a command of the station, an emergency, or a part of the gateway's.

    Attributes:
        service: arm, disarm or start_behavior; emergency; mission or external, which the gateway
            flies; message or period, which it sends.
        number, microseconds: of a message.
    """

    service: str
    action: str = ""
    name: str = ""
    arguments: dict[str, Any] = field(default_factory=dict)
    number: int = 0
    microseconds: float = 0.0


def wanted_of(message: Any, origin: Origin) -> Wanted | None:
    """Return what a COMMAND_LONG or COMMAND_INT asks for; None for a command that is not known.

    Raises RefusedError for one that this vehicle cannot do.
    """
    p1, p2, p3, p4 = message.param1, message.param2, message.param3, message.param4
    match message.command:
        case mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            if p1 >= 0.5:
                return Wanted("arm")
            return Wanted("emergency", "cut") if p2 == FORCED else Wanted("disarm")
        case mavlink.MAV_CMD_DO_FLIGHTTERMINATION:
            if not p1 >= 0.5:
                raise RefusedError("flight termination cannot be taken back")
            return Wanted("emergency", "land")
        case mavlink.MAV_CMD_NAV_TAKEOFF:
            return start("take_off", height=_height(message))
        case mavlink.MAV_CMD_NAV_LAND:
            return start("land")
        case mavlink.MAV_CMD_DO_REPOSITION:
            # A yaw is in rad, as MAVSDK sends it and MAVLink has it since 2024.
            yaw = {"yaw": swap_yaw(p4)} if math.isfinite(p4) else {}
            speed = {"speed": p1} if math.isfinite(p1) and p1 > 0.0 else {}
            return start("fly_to", **_point(message, origin), **yaw, **speed)
        case mavlink.MAV_CMD_DO_SET_MODE:
            return of_mode(int(p2), int(p3)) if math.isfinite(p2 + p3) else None
        case mavlink.MAV_CMD_MISSION_START:
            return Wanted("mission")
        case mavlink.MAV_CMD_DO_PAUSE_CONTINUE:
            if p1 >= 0.5:
                raise RefusedError("a mission cannot be continued; start it again")
            return start("hover")
        case mavlink.MAV_CMD_REQUEST_MESSAGE:
            return Wanted("message", number=_number(p1))
        case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            return Wanted("period", number=_number(p1), microseconds=p2)
        case mavlink.MAV_CMD_GET_HOME_POSITION:
            return Wanted("message", number=mavlink.MAVLINK_MSG_ID_HOME_POSITION)
        case mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES:
            return Wanted("message", number=mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    return None


def start(behavior: str, **arguments: Any) -> Wanted:
    """Return the request of a behavior."""
    return Wanted("start_behavior", name=behavior, arguments=arguments)


def of_mode(main: int, sub: int) -> Wanted:
    """Return what a mode starts. Raises RefusedError for a mode that is not there."""
    behavior = behavior_of(main, sub)
    if behavior in ("mission", "external"):
        return Wanted(behavior)
    if not behavior:
        raise RefusedError(
            f"mode {main}.{sub} is not there; there are take-off, hold, land, mission and offboard "
            "with the numbers of PX4"
        )
    return start(behavior)


def _number(value: float) -> int:
    return int(value) if 0.0 <= value < 2.0**24 else -1


def _height(message: Any) -> float:
    """Return the height over the start (m): the seventh number, 0 and none being the usual one."""
    height = getattr(message, "z", None) if message.get_type() == "COMMAND_INT" else message.param7
    return (
        float(height)
        if height is not None and math.isfinite(height) and height > 0.0
        else (TAKE_OFF_HEIGHT)
    )


def _point(message: Any, origin: Origin) -> dict[str, float]:
    """Return x, y, z (m) of a global place; what is not finite is left out."""
    if message.get_type() == "COMMAND_INT":
        if message.frame not in RELATIVE + ABSOLUTE:
            raise RefusedError(
                f"a place in frame {message.frame} is not flown to; send a global one, or a "
                "position set-point in LOCAL_NED"
            )
        latitude, longitude, altitude = 1e-7 * message.x, 1e-7 * message.y, message.z
        if message.frame in RELATIVE:
            altitude += origin.place.altitude
        if NO_INT in (message.x, message.y):
            latitude = longitude = math.nan
    else:
        latitude, longitude, altitude = message.param5, message.param6, message.param7
    x, y, z = origin.world_of(Place(latitude, longitude, altitude))
    point = {"x": x, "y": y, "z": z}
    return {name: value for name, value in point.items() if math.isfinite(value)}


NO_INT = 2**31 - 1
"""Stands for no number in a field of an integer."""
