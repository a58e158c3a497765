"""The facts about a Crazyflie that the flight stack needs, and the one that is simulated.

A Crazyflie 2.1+ with markers: mass and arm by the maker, inertia as identified by Förster (System
Identification of the Crazyflie 2.0, ETH Zürich, 2015). Its rotors are on the diagonals; the model
has them on the axes, with the same arm, which changes the limits of roll and pitch torque alone:
the board mixes.
"""

from __future__ import annotations

import math

from extensions.crazyflie.board.messages import ACCELEROMETER_SCALE, GYROSCOPE_SCALE
from quadrotor.parameter_description import ParameterValue
from vehicle.boards.board import CommandKind, Traits

_BODY: dict[str, ParameterValue] = {
    "mass": 0.032,
    "inertia_xx": 16.6e-6,
    "inertia_yy": 16.7e-6,
    "inertia_zz": 29.3e-6,
    "arm": 0.046,
    "torque_ratio": 0.006,
    "motor_slope": math.sqrt(0.12) / 255.0,
    "motor_offset": 0.0,
    "motor_reference_min": 30.0,
    "motor_reference_max": 255.0,
    "battery_nominal": 3.8,
}
TRAITS = Traits(
    "crazyflie",
    (CommandKind.RATES, CommandKind.ANGLES),
    {
        **{f"model.{name}": value for name, value in _BODY.items()},
        "imu.accelerometer_scale": ACCELEROMETER_SCALE,
        "imu.accelerometer_zero": 0.0,
        "imu.gyroscope_scale": GYROSCOPE_SCALE,
        "imu.gyroscope_zero": 0.0,
        "safety.gyro_samples": 100,
        "safety.battery_warning": 3.5,
        "safety.battery_land": 3.2,
        "safety.battery_reaction": "land",
        "safety.emergency_land": "descend",
        "near_hovering.stick_thrust": 0.314,
        "mass.mass_min": 0.02,
        "mass.mass_max": 0.1,
        "control.limits.yaw_torque_max": 0.0005,
        "behavior.trajectory_yaw_torque_max": 0.0003,
    },
)
SIMULATED: dict[str, ParameterValue] = {
    **_BODY,
    "ground_stiffness": 200.0,
    "ground_damping": 2.0,
    "battery_nominal": 15.2,
}
"""Parameters of the simulated vehicle; a quarter of its battery's four cells is reported."""
