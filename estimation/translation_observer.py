"""Observer of position, velocity and accelerometer bias (eq. 11), discretised per measurement.

The gain is stacked [Kp; Kv] (the paper shows one), and a bias gain is added which turns with the
body: b_dot = -R_wb^T Kb (r - r_hat). With a constant gain the bias loop is positive feedback beyond
90 degrees of yaw. A measurement is applied once with gains that put the error's poles over the
interval T since the last one at exp(-omega T): stable at any rate.

`pose` is (7,): position_w, then quaternion_wb.
"""

from __future__ import annotations

import math

from estimation.attitude_filter import Triple, to_world
from quadrotor.compiled import compiled
from quadrotor.records import Array
from quadrotor.vehicle_model import GRAVITY


@compiled
def translation_gains(bandwidth: float, bias_bandwidth: float, interval: float) -> Triple:
    """Return gains (1, 1/s, 1/s^2) on the innovation (m) for position, velocity and acceleration.

    With F = [[1, T, T^2/2], [0, 1, T], [0, 0, 1]], C = [1, 0, 0] and p = exp(-bandwidth T),
    s = exp(-bias_bandwidth T), the eigenvalues of (I - L C) F are p, p, s. With u = 1 - p and
    w = 1 - s, matching the characteristic polynomial gives the lines below; w = 0 is the double
    pole without bias, L1 = 1 - p^2, L2 = (1 - p)^2 / T.
    """
    u = -math.expm1(-bandwidth * interval)
    w = -math.expm1(-bias_bandwidth * interval)
    position = 2.0 * u - u * u + w * (1.0 - u) * (1.0 - u)
    velocity = u * (u + 2.0 * w - 1.5 * u * w) / interval
    return position, velocity, u * u * w / (interval * interval)


@compiled(inner=True)
def acceleration_of(pose: Array, specific_force_b: Array, bias_b: Array) -> Triple:
    """Return R_wb (a_m - b) + g, m/s^2 in world axes."""
    x, y, z = to_world(
        pose,
        1.0,
        specific_force_b[0] - bias_b[0],
        specific_force_b[1] - bias_b[1],
        specific_force_b[2] - bias_b[2],
    )
    return x, y, z - GRAVITY


@compiled(inner=True)
def move_pose(pose: Array, velocity_w: Array, start_w: Triple, end_w: Triple, dt: float) -> None:
    """Advance position and velocity in place; acceleration linear from start to end."""
    for i in range(3):
        a, b = start_w[i], end_w[i]
        pose[i] += dt * (velocity_w[i] + dt * (2.0 * a + b) / 6.0)
        velocity_w[i] += 0.5 * dt * (a + b)
