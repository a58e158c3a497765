"""The state that the microcontroller stores between its periods, and the period's gains."""

from __future__ import annotations

import numpy as np

from quadrotor.records import Record
from vehicle.simulator.firmware import constants

GAINS = (
    "turn",
    "rest",
    "drift",
    "drift_turned",
    "second",
    "up",
    "height",
    "height_resting",
    "climb",
    "bias",
    "bias_resting",
    "felt",
    "felt_bias",
    "integral",
    "thrust",
    "support",
    "lift",
    "shown",
    "pulling",
)
"""Gains that grow with the period, each computed from the constants of its name."""

PROGRAM = np.dtype(
    [
        ("up_b", "i8", 3),  # 2^-30: the world's z axis in body axes, a unit vector
        ("drift", "i8", 3),  # 2^-24 count, subtracted from the gyroscope's measurement
        ("rate_b", "i8", 3),  # 2^-16 count
        ("force_b", "i8", 3),  # count
        ("roll", "i8"),  # 2^-15 rad, as the pitch
        ("pitch", "i8"),
        ("height", "i8"),  # 2^-18 m, of the barometer's scale, 0 at zero pressure
        ("climb", "i8"),  # 2^-22 m/s
        ("climb_bias", "i8"),  # 2^-22 count, of the vertical specific force
        ("ground", "i8"),  # 2^-18 m, height of the last rest with motors off
        ("felt_climb", "i8"),  # 2^-22 m/s, by the accelerometer; the barometer only slowly
        ("felt_bias", "i8"),  # 2^-22 count, of the vertical specific force, for that
        ("doubted", "i8"),  # 2^-22 s, for which the barometer contradicts the accelerometer
        ("angle_integral", "i8", 2),  # 2^-30 rad s, roll and pitch
        ("rate_before", "i8"),  # 2^-16 count, yaw rate one period ago
        ("commanded", "i8"),  # 2^-24 N, thrust of the motors' references
        ("thrust", "i8"),  # 2^-24 N, commanded, averaged over 0.5 s
        ("support", "i8"),  # 2^-28, specific force along z_B over the thrust's in the air
        ("lift", "i8"),  # 2^-24 N, integral part of the descent's thrust
        ("sink", "i8"),  # 2^-22 m/s, reference in the descent
        ("lasted", "i8"),  # 2^-22 s, duration of the descent
        ("longest", "i8"),  # 2^-18 s, duration from which on it becomes faster
        ("faster", "i8"),  # 2^-22 m/s, of a descent that should have ended
        ("carried", "i8"),  # 2^-22 s, for which the ground has carried the vehicle
        ("struck", "i8"),  # 2^-22 s, since the ground hit the feet last
        ("try_at", "i8"),  # 2^-22 s, from which on this presumes the ground
        ("shown", "i8"),  # 2^-16 count, mean specific force along z_B in the descent
        ("pulling", "i8"),  # 2^-24 N, commanded thrust with the motors' lag
        ("held", "i8"),  # 2^-24 N, the descent's thrust before a test of the ground
        ("unloaded", "i8"),  # 2^-24 N, taken off the thrust to test the ground; 0 without a test
        ("began_at", "i8"),  # 2^-16 count, specific force by the thrust when the test began
        ("tested", "i8"),  # 2^-22 s, duration of the test
        ("falling", "i8"),  # 2^-22 s, for which it has shown the air
        ("refuted", "i8"),  # 2^-28, the support that looked like the ground
        ("turning", "i8"),  # 1: motors on, by command or autonomously
        ("landing", "i8"),  # 1: the descent is in control
        ("landed", "i8"),  # 1: the descent is over
        ("awake", "i8"),  # 1: the height is initialised
        ("state", "i8"),  # MotorState of the last period
        ("missing", "i8"),  # bits of the motors whose controllers do not answer
        ("references", "i8", 4),  # counts, on the motors' bus
        ("gains", [(name, "i8") for name in (*GAINS, "yaw_slope")]),
    ],
    align=True,
)


def new_program() -> Record:
    """Return a PROGRAM record, shape (1,), as at power-up."""
    program = np.zeros(1, PROGRAM)
    program["up_b"][:, 2] = 1 << 30
    program["support"] = 1 << 28
    set_period(program, 16_000)
    return program


def set_period(program: Record, sixteenths: int) -> None:
    """Set the gains of a PROGRAM (1,) for a period in 1/16 us."""
    period = min(constants.PERIOD_MAX, max(constants.PERIOD_MIN, sixteenths))
    gains = program["gains"]
    for name in GAINS:
        factor = getattr(constants, f"GAIN_{name.upper()}")
        shift = getattr(constants, f"GAIN_{name.upper()}_SHIFT")
        gains[name] = (period * factor + (1 << shift - 1)) >> shift
    gains["yaw_slope"] = constants.YAW_SLOPE // period
