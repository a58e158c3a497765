"""The near-hovering controller: angles, yaw rate and thrust to four motor references.

Gains are registers per unit inertia, which makes them bandwidths for any frame: a PID on roll and
pitch, and on the yaw rate a P with damping of its change.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from control.allocation import allocate
from quadrotor.compiled import compiled
from quadrotor.vehicle_model import reference_of_thrust
from vehicle.simulator.firmware.attitude import angles
from vehicle_link.serial.ids import Id

Item = Any
"""One record `array[k]` inside compiled code."""
Registers = npt.NDArray[np.int16]

GAIN_SCALE = 0.1
"""Value of a gain's register that means 1."""
INTEGRAL_MAX = 0.2
"""rad s, limit of the angle integral."""
INTEGRATED = 0.1
"""rad: a larger error is a manoeuvre, not a trim, and is not integrated."""
REFERENCE_MAX = 255

_GAIN_P, _GAIN_D, _GAIN_I = int(Id.GAIN_P), int(Id.GAIN_D), int(Id.GAIN_I)
_GAIN_YAW, _GAIN_YAW_ACCELERATION = int(Id.GAIN_YAW_RATE), int(Id.GAIN_YAW_ACCELERATION)
_TORQUE = int(Id.TORQUE_ROLL)

DEFAULT_GAINS = {
    Id.GAIN_P: 600,
    Id.GAIN_D: 120,
    Id.GAIN_I: 100,
    Id.GAIN_YAW_RATE: 120,
    Id.GAIN_YAW_ACCELERATION: 0,
}
"""In counts of GAIN_SCALE: 1/s^2, 1/s, 1/s^3; 1/s, 1."""


@compiled(inner=True)
def hold_angles(
    p: Item, registers: Registers, wanted: tuple[float, float, float], thrust: float, dt: float
) -> None:
    """Set the references of a PROGRAM for roll, pitch (rad), yaw rate (rad/s) and thrust (N)."""
    roll, pitch, _ = angles(p)
    x, y, z = p.angular_velocity_b[0], p.angular_velocity_b[1], p.angular_velocity_b[2]
    error_roll, error_pitch, error_yaw = wanted[0] - roll, wanted[1] - pitch, wanted[2] - z
    kp, kd, ki = (
        GAIN_SCALE * registers[_GAIN_P],
        GAIN_SCALE * registers[_GAIN_D],
        GAIN_SCALE * registers[_GAIN_I],
    )
    yaw_acceleration = (z - p.rate_before) / dt
    p.rate_before = z
    m = p.model
    torque = (
        m.inertia_b[0] * (kp * error_roll + ki * p.angle_integral[0] - kd * x),
        m.inertia_b[1] * (kp * error_pitch + ki * p.angle_integral[1] - kd * y),
        m.inertia_b[2]
        * GAIN_SCALE
        * (registers[_GAIN_YAW] * error_yaw - registers[_GAIN_YAW_ACCELERATION] * yaw_acceleration),
    )
    thrusts, scaling = allocate((thrust, torque[0], torque[1], torque[2]), m)
    if scaling == 1.0 and abs(error_roll) + abs(error_pitch) < INTEGRATED:
        p.angle_integral[0] = _bounded(p.angle_integral[0] + error_roll * dt)
        p.angle_integral[1] = _bounded(p.angle_integral[1] + error_pitch * dt)
    for i in range(4):
        reference = reference_of_thrust(thrusts[i], m.motor_slope, m.motor_offset)
        p.references[i] = min(REFERENCE_MAX, int(reference + 0.5))
    for i in range(3):
        registers[_TORQUE + i] = int(1000.0 * torque[i])


@compiled(inner=True)
def _bounded(integral: float) -> float:
    return min(INTEGRAL_MAX, max(-INTEGRAL_MAX, integral))
