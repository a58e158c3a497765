"""Behaviors as MAVLink's modes, and back.

Only PX4 and ArduPilot have numbers for their modes. MAVSDK reads those of an autopilot that is
neither as PX4's (main mode in bits 16 to 23 of the custom mode, sub-mode in bits 24 to 31), so
these are sent. https://github.com/mavlink/MAVSDK, flight_mode.cpp.
"""

from __future__ import annotations

ALTCTL, POSCTL, AUTO, OFFBOARD = 2, 3, 4, 6  # main modes
READY, TAKEOFF, LOITER, MISSION, LAND = 1, 2, 3, 4, 6  # sub-modes of AUTO

MODE_OF: dict[str, tuple[int, int]] = {
    "ground": (AUTO, READY),
    "take_off": (AUTO, TAKEOFF),
    "hover": (AUTO, LOITER),
    "brake": (AUTO, LOITER),
    "fly_to": (AUTO, LOITER),
    "follow_trajectory": (AUTO, MISSION),
    "excite": (AUTO, MISSION),
    "land": (AUTO, LAND),
    "emergency_landing": (AUTO, LAND),
    "velocity": (POSCTL, 0),
    "near_hovering": (ALTCTL, 0),
    "external": (OFFBOARD, 0),
}
"""Main mode and sub-mode of each behavior."""

BEHAVIOR_OF: dict[tuple[int, int], str] = {
    (AUTO, TAKEOFF): "take_off",
    (AUTO, LOITER): "hover",
    (AUTO, LAND): "land",
    (AUTO, MISSION): "mission",
    (OFFBOARD, 0): "external",
}
"""What a mode that is asked for starts; "mission" is the uploaded one."""


def custom_mode(behavior: str) -> int:
    """Return the custom mode of a heartbeat."""
    main, sub = MODE_OF.get(behavior, (AUTO, LOITER))
    return main << 16 | sub << 24


def behavior_of(main: int, sub: int) -> str:
    """Return what the mode starts, "" for a mode that this vehicle does not have."""
    return BEHAVIOR_OF.get((main, sub if main == AUTO else 0), "")
