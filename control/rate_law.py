"""The body rates and the throttle that carry out a wrench, for boards with an inner loop.

Eq. 5 demands J K_w (E w_d - w) for the rates, and everything else of it (attitude error, integral,
feed-forward) as a torque on top of that. A board that holds rates by itself, with about the
stiffness K_w, applies the same torque when it is given the rates

    w_c = w + K_w^-1 J^-1 (tau - w x J w),

which is E w_d + K_w^-1 (K_R e_R + K_f integral + feed-forward): the measured rate drops out. The
gyroscopic term is left to the board.

A board that holds angles demands the rate k (angle - measured angle) of its rate loop. It demands
the same w_c when it is given the angles that differ from the measured ones by w_c / k, whatever the
gains of eq. 5.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.records import Record
from quadrotor.rotations import euler_from_quaternion
from quadrotor.vectors import cross, times, vector
from quadrotor.vehicle_model import reference_of_thrust

REFERENCE_MAX = 255.0
"""Counts of a motor reference at full throttle."""


@compiled
def rates_of_wrench(
    wrench: npt.NDArray[np.float64],
    omega_b: npt.NDArray[np.float64],
    gains: Record,
    model: Record,
    rate_max: float,
) -> tuple[float, float, float, float]:
    """Return body rates (rad/s, each within +-rate_max) and throttle (0 to 1) of a wrench.

    Args:
        wrench: (4,) N and N m, within the motors' limits.
        omega_b: (3,) rad/s.
        gains, model: CONTROL (1,), MODEL (1,). The throttle is the mean motor reference over 255,
            by the model's motor law.
    """
    g, m = gains[0], model[0]
    omega, J = vector(omega_b), vector(m.inertia_b)
    gyroscopic = cross(omega, times(J, omega))
    x = omega[0] + (wrench[1] - gyroscopic[0]) / (J[0] * g.kw[0])
    y = omega[1] + (wrench[2] - gyroscopic[1]) / (J[1] * g.kw[1])
    z = omega[2] + (wrench[3] - gyroscopic[2]) / (J[2] * g.kw[2])
    reference = reference_of_thrust(0.25 * wrench[0], m.motor_slope, m.motor_offset)
    return (
        min(rate_max, max(-rate_max, x)),
        min(rate_max, max(-rate_max, y)),
        min(rate_max, max(-rate_max, z)),
        min(1.0, reference / REFERENCE_MAX),
    )


@compiled
def angles_of_rates(
    quaternion_wb: npt.NDArray[np.float64], roll_rate: float, pitch_rate: float, gain: float
) -> tuple[float, float]:
    """Return the roll and pitch, rad, by which an angle loop of this gain (1/s) demands the rates.

    Args:
        roll_rate, pitch_rate: rad/s, about x and y of the body.
    """
    roll, pitch, _ = euler_from_quaternion(quaternion_wb)
    return roll + roll_rate / gain, pitch + pitch_rate / gain
