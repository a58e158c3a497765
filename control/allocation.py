"""Thrusts within their limits by uniform scaling, end of Sec. 4."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from control.parameters import Item
from quadrotor.compiled import compiled
from quadrotor.vehicle_model import GRAVITY, thrusts_of_wrench

Array = npt.NDArray[np.float64]


@compiled
def allocate(wrench: Array, model: Item, thrusts: Array) -> float:
    """Feasible thrusts (N, (4,)) into `thrusts`; returns the scaling lambda, 0..1.

    The paper's problem in one variable has the closed form
    lambda = min(1, (f_max - f_g) / f_r where f_r > 0, (f_min - f_g) / f_r where f_r < 0)
    with f_g = M^-1 u_g and f_r = M^-1 u_res.

    Departs from print: A^-1 there is M^-1; and where gravity alone is infeasible the problem
    is empty, so f_g is clipped to the limits first and the rest is what is left of u.
    A wrench that is not finite gives f_g and lambda = 0: never a NaN to the motors.

    Args:
        wrench: (4,) thrust (N) and torques (N m).
        model: one MODEL record.
    """
    low, high = model.thrust_min, model.thrust_max
    gravity = min(high, max(low, 0.25 * model.mass * GRAVITY))
    wanted = thrusts_of_wrench(wrench, model.arm, model.torque_ratio)
    scaling = 1.0
    for i in range(4):
        rest = wanted[i] - gravity
        if not math.isfinite(rest):
            scaling = 0.0
        elif rest > high - gravity:
            scaling = min(scaling, (high - gravity) / rest)
        elif rest < low - gravity:
            scaling = min(scaling, (low - gravity) / rest)
    for i in range(4):
        # The clamp only takes back the last bit of rounding.
        share = scaling * (wanted[i] - gravity) if scaling > 0.0 else 0.0
        thrusts[i] = min(high, max(low, gravity + share))
    return scaling
