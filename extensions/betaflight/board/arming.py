"""The reasons why Betaflight refuses to arm, each with its remedy."""

from __future__ import annotations

REASONS: tuple[tuple[str, str], ...] = (
    ("NOGYRO", "no gyroscope was found: check the board or its firmware target"),
    ("FAILSAFE", "its failsafe is active: send commands again and wait, then arm"),
    ("RXLOSS", "it receives no stick commands: check the CRSF line, or `feature RX_MSP`"),
    ("NOT_DISARMED", "its signal returned with the arm switch on: disarm, then arm"),
    ("BOXFAILSAFE", "its failsafe switch is on: switch it off"),
    ("RUNAWAY", "it stopped a runaway take-off: check motor order, directions and propellers"),
    ("CRASH", "it detected a crash: disarm, inspect the vehicle, then arm"),
    ("THROTTLE", "the throttle is not at its lowest: check `min_check` and the channel map"),
    ("ANGLE", "it is not level: set it down level, or see `small_angle`"),
    ("BOOTGRACE", "it was switched on just now: wait some seconds"),
    ("NOPREARM", "its pre-arm switch is off: remove the mode PREARM"),
    ("LOAD", "its processor is overloaded: lower `pid_process_denom`'s rate or turn features off"),
    ("CALIB", "it calibrates its gyroscope: keep the vehicle still"),
    ("CLI", "its command line is open: leave it by `exit`"),
    ("CMS", "its menu is open: leave the menu"),
    ("BST", "it is locked over the black-sheep bus: unplug what is there"),
    ("MSP", "a configurator has locked it: close the configurator and unplug its USB"),
    ("PARALYZE", "it is paralysed: switch it off and on"),
    ("GPS", "GPS rescue waits for satellites: turn GPS rescue off indoors"),
    ("RESCUE_SW", "its GPS-rescue switch is on: switch it off"),
    ("DSHOT_TELEM", "motors send no telemetry: check the speed controllers or `dshot_bidir`"),
    ("REBOOT_REQD", "its settings need a restart: switch it off and on"),
    ("DSHOT_BBANG", "DShot does not work by bit-banging: set `dshot_bitbang = OFF`"),
    ("NO_ACC_CAL", "its accelerometer was never calibrated: do that in the configurator, level"),
    ("MOTOR_PROTO", "no motor protocol is chosen: set `motor_pwm_protocol`"),
    ("FLIP_SWITCH", "its crash-flip switch is on: remove the mode FLIP OVER AFTER CRASH"),
    ("ALT_HOLD_SW", "its altitude-hold switch is on: remove the mode ALTHOLD"),
    ("POS_HOLD_SW", "its position-hold switch is on: remove the mode POSHOLD"),
    ("AUTOPILOT_SW", "its autopilot switch is on: remove that mode"),
    ("ARM_SWITCH", "the arm switch was on while it could not arm: disarm, then arm"),
)
"""(name in its command line's `status`, problem and remedy), in the order of the bits."""

JUST_SWITCHED_ON = 1 << [name for name, _ in REASONS].index("BOOTGRACE")


def why_not_armed(flags: int, count: int = len(REASONS)) -> str:
    """Return the reasons that block arming as text, "" for 0.

    Args:
        count: number of reasons in this firmware version. ARM_SWITCH is always the last of them; it
            is also set whenever another reason blocked arming, so it is reported only on its own.
    """
    names = (*REASONS[: min(count, len(REASONS)) - 1], REASONS[-1])
    consequence = 1 << len(names) - 1
    shown = flags & ~consequence or flags
    reasons = [f"{name}: {why}" for k, (name, why) in enumerate(names) if shown >> k & 1]
    unknown = shown >> len(names)
    if unknown:
        reasons.append(f"unknown reason {unknown << len(names):#x}: is the firmware newer?")
    return "; ".join(reasons)
