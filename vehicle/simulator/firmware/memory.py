"""The state of the microcontroller that is kept between its periods."""

from __future__ import annotations

import numpy as np

from quadrotor.records import Record
from quadrotor.vehicle_model import GRAVITY, MODEL, VehicleModel

PROGRAM = np.dtype(
    [
        ("quaternion_wb", "f8", 4),
        ("gyroscope_bias", "f8", 3),  # rad/s, subtracted from what is measured
        ("angular_velocity_b", "f8", 3),  # rad/s
        ("specific_force_b", "f8", 3),  # m/s^2
        ("height", "f8"),  # m, of the barometer's scale, 0 where the pressure is 0
        ("climb", "f8"),  # m/s
        ("climb_bias", "f8"),  # m/s^2, of the vertical specific force
        ("ground", "f8"),  # m, height of the last rest with motors off
        ("angle_integral", "f8", 2),  # rad s, roll and pitch
        ("rate_before", "f8"),  # rad/s, yaw rate one period ago
        ("thrust", "f8"),  # N, commanded, averaged over THRUST_TIME
        ("support", "f8"),  # specific force along z_B over what the thrust gives in the air
        ("lift", "f8"),  # N, integral part of the descent's thrust
        ("sink", "f8"),  # m/s, wanted in the descent
        ("carried", "f8"),  # s, the ground has carried the vehicle
        ("turning", "i8"),  # 1: motors on, commanded or by itself
        ("landing", "i8"),  # 1: the descent is in control
        ("landed", "i8"),  # 1: the descent is over
        ("awake", "i8"),  # 1: attitude and height are initialised
        ("state", "i8"),  # MotorState of the last period
        ("missing", "i8"),  # bits of the motors whose controllers do not answer
        ("references", "i8", 4),  # counts, on the motors' bus
        ("model", MODEL),
    ],
    align=True,
)


def new_program() -> Record:
    """Return a PROGRAM record, shape (1,), as at power-up.

    The model is the nominal vehicle's: the true one may differ.
    """
    program = np.zeros(1, PROGRAM)
    program["quaternion_wb"][:, 0] = 1.0
    program["specific_force_b"][:, 2] = GRAVITY
    program["support"] = 1.0
    program["model"] = VehicleModel().record()
    return program
