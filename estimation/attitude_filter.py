"""Passive complementary filter on unit quaternions (eq. 12) with the norm penalty.

Between measurements the quaternion follows the gyroscope exactly (a constant rate turns it by
its exponential). A measurement is applied once, when it arrives, with the share that the
continuous law would have corrected since the one before: stable at any rate, while the printed
gain times the measurement period diverges below gain / 2 per second. The estimate of the
gyroscope bias is Mahony's (reference [10] of the paper, left out there); zero bandwidth holds it.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from quadrotor.rotations import quaternion_conjugate, quaternion_exp, quaternion_multiply

Array = npt.NDArray[np.float64]


@njit(cache=True)
def attitude_gains(bandwidth: float, bias_bandwidth: float, interval: float) -> tuple[float, float]:
    """Gains (1, 1/s) on the innovation (rad) for the attitude and for minus the gyroscope bias.

    The error's poles over one `interval` (s) are exp(-bandwidth interval) and
    exp(-bias_bandwidth interval); without bias this is 1 - exp(-K_est,q interval).
    """
    u = -math.expm1(-bandwidth * interval)
    w = -math.expm1(-bias_bandwidth * interval)
    return u + w - u * w, u * w / interval


@njit(cache=True)
def propagate_attitude(q_wb: Array, omega_b: Array, penalty: float, dt: float) -> None:
    """Turn q_wb (4,) in place by the body rate omega_b (3,) held for dt (s).

    The scalar part 2 lambda (1 - |q|^2) printed below eq. 12 only scales q; its decay of
    |q| - 1 is taken exactly, exp(-2 lambda dt), so that no penalty is too large for dt.
    """
    turn = np.empty(3)
    for i in range(3):
        turn[i] = omega_b[i] * dt
    turned = quaternion_multiply(q_wb, quaternion_exp(turn))
    norm2 = 0.0
    for i in range(4):
        norm2 += turned[i] * turned[i]
    scale = 1.0 - 0.5 * math.expm1(-2.0 * penalty * dt) * (1.0 - norm2)
    for i in range(4):
        q_wb[i] = scale * turned[i]


@njit(cache=True)
def attitude_innovation(estimated_wb: Array, measured_wb: Array, out_b: Array) -> None:
    """2 dq_s dq_v with dq = estimated* (x) measured, both (4,) unit, into out_b (3,), rad.

    It is the sine of the error angle about its axis in body axes, the same for +-q, and zero
    also for an error of exactly 180 degrees (the passive filter's unstable equilibrium).
    """
    dq = quaternion_multiply(quaternion_conjugate(estimated_wb), measured_wb)
    for i in range(3):
        out_b[i] = 2.0 * dq[0] * dq[1 + i]
