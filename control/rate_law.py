"""The body rates and the throttle that carry out a wrench, for boards with an inner loop.

Eq. 5 demands J K_w (E w_d - w) for the rates, and everything else of it (attitude error, integral,
feed-forward) as a torque on top of that. A board that holds rates by itself, with about the
stiffness K_w, applies the same torque when it is given the rates

    w_c = w + K_w^-1 J^-1 (tau - w x J w),

which is E w_d + K_w^-1 (K_R e_R + K_f integral + feed-forward): the measured rate drops out. The
gyroscopic term is left to the board.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.records import Record
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
