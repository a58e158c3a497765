"""MAVLink's commands and modes as ours: what each asks for.

Only PX4 and ArduPilot have numbers for their modes. MAVSDK reads those of an autopilot that is
neither as PX4's (main mode in bits 16 to 23 of the custom mode, sub-mode in bits 24 to 31), so
these are used. https://github.com/mavlink/MAVSDK, flight_mode.cpp.
"""

from __future__ import annotations

import math
from typing import Any

from extensions.mavlink.dialect import MAVLink_message, mavlink
from extensions.mavlink.frames import Origin, Place, Vector, swap_yaw
from quadrotor.errors import RefusedError

ALTCTL, POSCTL, AUTO, OFFBOARD = 2, 3, 4, 6  # main modes
READY, TAKEOFF, LOITER, MISSION, LAND = 1, 2, 3, 4, 6  # sub-modes of AUTO
MODES: dict[str, tuple[int, int]] = {
    "ground": (AUTO, READY),
    "take_off": (AUTO, TAKEOFF),
    "hover": (AUTO, LOITER),
    "follow_trajectory": (AUTO, MISSION),
    "excite": (AUTO, MISSION),
    "land": (AUTO, LAND),
    "emergency_landing": (AUTO, LAND),
    "velocity": (POSCTL, 0),
    "near_hovering": (ALTCTL, 0),
    "external": (OFFBOARD, 0),
}
"""Main mode and sub-mode of the behaviors; of the others they are those of hover."""
FORCED = 21196
"""Second number of a disarming that also stops motors in flight, by MAVLink's definition."""
TAKE_OFF_HEIGHT = 1.0
NO_INT = 2**31 - 1
"""Stands for no number in an integer field."""
RELATIVE = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
GLOBAL = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT, *RELATIVE)

Wanted = tuple[str, dict[str, Any]]
"""A command of the station with its fields; or mission and external, which the gateway flies; or
message and period, which it sends."""


def custom_mode(behavior: str) -> int:
    """Return the custom mode of a heartbeat."""
    main, sub = MODES.get(behavior, MODES["hover"])
    return main << 16 | sub << 24


def wanted_of(message: MAVLink_message, origin: Origin) -> Wanted | None:
    """Return what a COMMAND_LONG or COMMAND_INT asks for; None for a command that is not known.

    Raises RefusedError for one that this vehicle cannot do.
    """
    p1, p2, p3, p4 = message.param1, message.param2, message.param3, message.param4
    is_int = message.get_type() == "COMMAND_INT"
    match message.command:
        case mavlink.MAV_CMD_COMPONENT_ARM_DISARM if p1 >= 0.5:
            return "arm", {}
        case mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            return ("emergency", {"action": "cut"}) if p2 == FORCED else ("disarm", {})
        case mavlink.MAV_CMD_DO_FLIGHTTERMINATION if p1 >= 0.5:
            return "emergency", {"action": "land"}
        case mavlink.MAV_CMD_NAV_TAKEOFF:
            height = message.z if is_int else message.param7
            return behavior("take_off", height=height if height > 0.0 else TAKE_OFF_HEIGHT)
        case mavlink.MAV_CMD_NAV_LAND:
            return behavior("land")
        case mavlink.MAV_CMD_DO_REPOSITION:
            if is_int:
                is_left_out = NO_INT in (message.x, message.y)
                latitude = math.nan if is_left_out else 1e-7 * message.x
                x, y, z = world_point(message.frame, latitude, 1e-7 * message.y, message.z, origin)
                x = math.nan if is_left_out else x
            else:
                place = Place(message.param5, message.param6, message.param7)
                x, y, z = origin.world_of(place)
            given = {"x": x, "y": y, "z": z, "yaw": swap_yaw(p4)}
            given["speed"] = p1 if p1 > 0.0 else math.nan
            return behavior("fly_to", **{k: v for k, v in given.items() if math.isfinite(v)})
        case mavlink.MAV_CMD_DO_SET_MODE if math.isfinite(p2 + p3):
            return of_mode(int(p2), int(p3))
        case mavlink.MAV_CMD_MISSION_START:
            return "mission", {}
        case mavlink.MAV_CMD_DO_PAUSE_CONTINUE if p1 < 0.5:
            return behavior("hover")
        case mavlink.MAV_CMD_REQUEST_MESSAGE if math.isfinite(p1):
            return "message", {"number": int(p1)}
        case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL if math.isfinite(p1 + p2):
            return "period", {"number": int(p1), "microseconds": p2}
    return None


def behavior(name: str, **arguments: object) -> Wanted:
    """Return the request of a behavior."""
    return "start_behavior", {"name": name, "arguments": arguments}


def of_mode(main: int, sub: int) -> Wanted:
    """Return the behavior that a mode starts. Raises RefusedError for an unavailable mode."""
    match main, sub:
        case 6, _:
            return "external", {}
        case 3, _:
            return behavior("velocity")
        case 4, 4:
            return "mission", {}
        case 4, (2 | 3 | 6):
            return behavior({TAKEOFF: "take_off", LOITER: "hover", LAND: "land"}[sub])
    raise RefusedError(
        f"mode {main}.{sub} cannot be chosen; there are position, take-off, hold, land, mission "
        "and offboard with the numbers of PX4"
    )


def world_point(
    frame: int, latitude: float, longitude: float, altitude: float, origin: Origin
) -> Vector:
    """Return the point of the world (m) at a place in a global frame. Raises RefusedError for
    another frame.
    """
    if frame not in GLOBAL:
        raise RefusedError(f"places in frame {frame} are not supported; send a global one")
    above = origin.place.altitude if frame in RELATIVE else 0.0
    return origin.world_of(Place(latitude, longitude, altitude + above))
