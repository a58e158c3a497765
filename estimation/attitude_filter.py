"""Passive complementary filter on unit quaternions (eq. 12) with the norm penalty.

Between measurements the quaternion follows the gyroscope exactly (a constant rate turns it by its
exponential). A measurement is applied once, when it arrives, with the share that the continuous law
would have corrected since the previous one. This is stable at any rate, while the printed gain
times the measurement period diverges below gain / 2 poses a second. The gyroscope's bias, which the
paper omits, is estimated as in its reference [10]; zero bandwidth holds it.

`pose` is (7,): position_w, then quaternion_wb. Written in scalars: see quadrotor.rotations.
"""

from __future__ import annotations

import math

from quadrotor.compiled import compiled
from quadrotor.records import Array

Triple = tuple[float, float, float]


@compiled
def attitude_gains(bandwidth: float, bias_bandwidth: float, interval: float) -> tuple[float, float]:
    """Return gains (1, 1/s) on the innovation (rad) for the attitude and for minus the gyroscope
    bias.

    The error's poles over one `interval` (s) are exp(-bandwidth interval) and exp(-bias_bandwidth
    interval); without bias the first gain is 1 - exp(-K_est,q interval).
    """
    u = -math.expm1(-bandwidth * interval)
    w = -math.expm1(-bias_bandwidth * interval)
    return u + w - u * w, u * w / interval


@compiled(inner=True)
def turn_pose(pose: Array, x: float, y: float, z: float, penalty: float, dt: float) -> None:
    """Turn the attitude of `pose` in place by the body rate (x, y, z) rad/s held for dt (s).

    The scalar part 2 lambda (1 - |q|^2) printed below eq. 12 only scales q; the decay of |q| - 1 is
    computed exactly, exp(-2 lambda dt), so that no penalty is too large for dt.
    """
    half = 0.5 * dt
    angle = half * math.sqrt(x * x + y * y + z * z)
    scale = half * (math.sin(angle) / angle if angle > 1e-9 else 1.0)
    a, b, c, d = scale * x, scale * y, scale * z, math.cos(angle)
    qw, qx, qy, qz = pose[3], pose[4], pose[5], pose[6]
    rw = qw * d - qx * a - qy * b - qz * c
    rx = qw * a + qx * d + qy * c - qz * b
    ry = qw * b + qy * d + qz * a - qx * c
    rz = qw * c + qz * d + qx * b - qy * a
    excess = rw * rw + rx * rx + ry * ry + rz * rz - 1.0
    k = 1.0 + 0.5 * math.expm1(-2.0 * penalty * dt) * excess
    pose[3], pose[4], pose[5], pose[6] = k * rw, k * rx, k * ry, k * rz


@compiled(inner=True)
def attitude_innovation(pose: Array, measured_wb: Array) -> Triple:
    """Return 2 dq_s dq_v with dq = estimated* (x) measured (4,), rad about body axes.

    It is the sine of the error angle about its axis, the same for +-q, and zero also for an
    error of exactly 180 degrees (the passive filter's unstable equilibrium).
    """
    w, x, y, z = pose[3], -pose[4], -pose[5], -pose[6]
    a, b, c, d = measured_wb[0], measured_wb[1], measured_wb[2], measured_wb[3]
    s = 2.0 * (w * a - x * b - y * c - z * d)
    return (
        s * (w * b + a * x + y * d - z * c),
        s * (w * c + a * y + z * b - x * d),
        s * (w * d + a * z + x * c - y * b),
    )


@compiled(inner=True)
def to_world(pose: Array, sign: float, x: float, y: float, z: float) -> Triple:
    """Return R_wb (x, y, z) for sign +1; R_wb^T (x, y, z), to body axes, for sign -1."""
    w, a, b, c = pose[3], sign * pose[4], sign * pose[5], sign * pose[6]
    tx, ty, tz = 2.0 * (b * z - c * y), 2.0 * (c * x - a * z), 2.0 * (a * y - b * x)
    return (
        x + w * tx + b * tz - c * ty,
        y + w * ty + c * tx - a * tz,
        z + w * tz + a * ty - b * tx,
    )
