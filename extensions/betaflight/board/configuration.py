"""The settings that a board with Betaflight needs, and their comparison with what it has.

Settings are read over the firmware's command line, which opens on the MSP port after `#`. Each
difference is reported as the line that a person has to enter there, followed by the value found
behind a `#`, which the firmware ignores.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from extensions.betaflight.board.messages import ANGLE_BOX, ARM_BOX, FAILSAFE_BOX
from extensions.betaflight.board.options import BetaflightOptions

MAY_LACK = ("throttle_boost", "vbat_sag_compensation", "ap_hover_throttle", "alt_hold_climb_rate")
"""Settings that a build of the firmware may lack; the feature that they set is missing then too."""
SWITCHES = (ARM_BOX, ANGLE_BOX, FAILSAFE_BOX)
"""Modes by auxiliary channel: AUX1 arms, AUX2 holds angles, AUX3 lands at once."""
_SETTING = re.compile(r"^(?:set )?(\w+) = (.*?)\s*$", re.MULTILINE)
_RANGE = re.compile(r"^aux (\d+) (\d+) (\d+) (\d+) (\d+)", re.MULTILINE)


def required(options: BetaflightOptions) -> dict[str, str]:
    """Return {setting: value} as the command line shows them."""
    rate = str(round(options.rate_max / 10.0))
    axes = ("roll", "pitch", "yaw")
    settings = {"rates_type": "ACTUAL"}
    settings |= {f"{axis}_rc_rate": rate for axis in axes}
    settings |= {f"{axis}_srate": rate for axis in axes}
    settings |= {f"{axis}_expo": "0" for axis in axes}
    if options.level == "angles":
        settings["angle_p_gain"] = str(round(10.0 * options.angle_gain))
        settings |= {"angle_feedforward": "0", "angle_earth_ref": "0"}
    return settings | {
        "deadband": "0",
        "yaw_deadband": "0",
        "min_check": str(options.min_check),
        "thr_expo": "0",
        "throttle_limit_type": "OFF",
        "throttle_boost": "0",
        "vbat_sag_compensation": "0",
        "rc_smoothing": "OFF",
        "angle_limit": str(round(options.angle_max)),
        "motor_idle": str(round(options.idle * 100.0)),
        "serial_update_rate_hz": "2000",
        "failsafe_delay": str(round(options.failsafe_delay * 10.0)),
        "failsafe_throttle": str(options.landing_throttle),
        "failsafe_landing_time": str(options.landing_time),
        "failsafe_procedure": "AUTO-LAND",
        "ap_hover_throttle": str(options.hover_throttle),
        "alt_hold_climb_rate": str(round(options.landing_speed * 10.0)),
        "failsafe_switch_mode": "STAGE2",
        "failsafe_recovery_delay": "1",
        "runaway_takeoff_prevention": "OFF",
    }


def mode_lines() -> list[str]:
    """Return the lines that assign the modes to their switches."""
    return [f"aux {k} {box} {k} 1700 2100 0 0" for k, box in enumerate(SWITCHES)]


def lines_to_enter(answer: str, options: BetaflightOptions) -> list[str]:
    """Return the lines to enter until the board's settings match; none when they do.

    Args:
        answer: the command line's output for `dump`.
    """
    found = dict(_SETTING.findall(answer))
    lines = [
        f"set {name} = {value}  # {_was(found.get(name))}"
        for name, value in required(options).items()
        if found.get(name, value if found and name in MAY_LACK else "").upper() != value
    ]
    ranges = {
        (int(box), int(aux)): (int(low), int(high))
        for _, box, aux, low, high in _RANGE.findall(answer)
        if low != high
    }
    wanted = {(box, aux): (1700, 2100) for aux, box in enumerate(SWITCHES)}
    if {key: ranges.get(key) for key in wanted} != wanted or _on_another_switch(ranges, wanted):
        lines += mode_lines()
    return [*lines, "save"] if lines else []


def _was(value: str | None) -> str:
    return "it was not there" if value is None else f"it was {value}"


def _on_another_switch(
    ranges: Mapping[tuple[int, int], tuple[int, int]], wanted: Mapping[tuple[int, int], object]
) -> bool:
    boxes: Sequence[int] = SWITCHES
    return any(box in boxes and (box, aux) not in wanted for box, aux in ranges)
