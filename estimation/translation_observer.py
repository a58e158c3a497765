"""Observer of position, velocity and accelerometer bias (eq. 11), discretised per measurement.

The gain is stacked [Kp; Kv] (print shows one), and a bias gain is added which turns with the
body: b_dot = -R_wb^T Kb (r - r_hat). With a constant gain the bias loop is positive feedback
beyond 90 degrees of yaw. A measurement is applied once with gains that put the error's poles over
the interval T since the last one at exp(-omega T): stable at any rate.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from quadrotor.rotations import rotate
from quadrotor.vehicle_model import GRAVITY

Array = npt.NDArray[np.float64]


@njit(cache=True)
def translation_gains(
    bandwidth: float, bias_bandwidth: float, interval: float
) -> tuple[float, float, float]:
    """Gains (1, 1/s, 1/s^2) on the innovation (m) for position, velocity and acceleration.

    With F = [[1, T, T^2/2], [0, 1, T], [0, 0, 1]], C = [1, 0, 0] and p = exp(-bandwidth T),
    s = exp(-bias_bandwidth T), the eigenvalues of (I - L C) F are p, p, s. With u = 1 - p and
    w = 1 - s, matching the characteristic polynomial gives the lines below; w = 0 is the double
    pole without bias, L1 = 1 - p^2, L2 = (1 - p)^2 / T.
    """
    u = -math.expm1(-bandwidth * interval)
    w = -math.expm1(-bias_bandwidth * interval)
    position = 2.0 * u - u * u + w * (1.0 - u) * (1.0 - u)
    velocity = u * (u + 2.0 * w - 1.5 * u * w) / interval
    acceleration = u * u * w / (interval * interval)
    return position, velocity, acceleration


@njit(cache=True)
def acceleration_of(q_wb: Array, specific_force_b: Array, bias_b: Array) -> Array:
    """R_wb (a_m - b) + g (3,), m/s^2 in world axes."""
    unbiased = np.empty(3)
    for i in range(3):
        unbiased[i] = specific_force_b[i] - bias_b[i]
    out = rotate(q_wb, unbiased)
    out[2] -= GRAVITY
    return out


@njit(cache=True)
def propagate_translation(
    position_w: Array, velocity_w: Array, start_w: Array, end_w: Array, dt: float
) -> None:
    """Advance position and velocity (3,) in place; acceleration linear from start to end."""
    for i in range(3):
        mean = 0.5 * (start_w[i] + end_w[i])
        position_w[i] += dt * (velocity_w[i] + dt * (2.0 * start_w[i] + end_w[i]) / 6.0)
        velocity_w[i] += dt * mean
