"""Rotations: quaternions (w, x, y, z) body to world, SO(3) exp and log, hat.

Compiled functions on small arrays, written without array expressions (numba compiles those
an order of magnitude more slowly). Arguments: vectors (3,), quaternions (4,), matrices (3, 3),
all float64. `R_wb` maps body to world. The conventions are in docs/conventions.md.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled

Array = npt.NDArray[np.float64]

_SMALL_ANGLE = 1e-6  # below, series to O(angle^2): relative error under 1e-12


@compiled
def hat(v: Array) -> Array:
    """Return the skew matrix of v, so that hat(v) @ u = v x u."""
    out = np.zeros((3, 3))
    out[0, 1], out[0, 2] = -v[2], v[1]
    out[1, 0], out[1, 2] = v[2], -v[0]
    out[2, 0], out[2, 1] = -v[1], v[0]
    return out


@compiled
def cross(a: Array, b: Array) -> Array:
    """Return a x b."""
    out = np.empty(3)
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out


@compiled
def norm(v: Array) -> float:
    """Return the Euclidean length of v, of any dimension."""
    total = 0.0
    for i in range(v.shape[0]):
        total += v[i] * v[i]
    return math.sqrt(total)


@compiled
def quaternion_multiply(p: Array, q: Array) -> Array:
    """Return the Hamilton product p (x) q, as printed in Sec. 6.1 of the paper."""
    out = np.empty(4)
    out[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    out[1] = p[0] * q[1] + q[0] * p[1] + p[2] * q[3] - p[3] * q[2]
    out[2] = p[0] * q[2] + q[0] * p[2] + p[3] * q[1] - p[1] * q[3]
    out[3] = p[0] * q[3] + q[0] * p[3] + p[1] * q[2] - p[2] * q[1]
    return out


@compiled
def quaternion_conjugate(q: Array) -> Array:
    """Return the inverse rotation of a unit quaternion."""
    out = np.empty(4)
    out[0], out[1], out[2], out[3] = q[0], -q[1], -q[2], -q[3]
    return out


@compiled
def quaternion_normalize(q: Array) -> Array:
    """Return q scaled to unit length; q must not be zero."""
    length = norm(q)
    out = np.empty(4)
    for i in range(4):
        out[i] = q[i] / length
    return out


@compiled
def quaternion_exp(phi: Array) -> Array:
    """Return the unit quaternion of the rotation vector phi (rad); phi = 0 gives (1, 0, 0, 0)."""
    angle = norm(phi)
    out = np.empty(4)
    if angle < _SMALL_ANGLE:
        s = 0.5 - angle * angle / 48.0
        out[0] = 1.0 - angle * angle / 8.0
    else:
        s = math.sin(0.5 * angle) / angle
        out[0] = math.cos(0.5 * angle)
    out[1], out[2], out[3] = s * phi[0], s * phi[1], s * phi[2]
    return out


@compiled
def quaternion_log(q: Array) -> Array:
    """Return the rotation vector (rad, length <= pi) of a unit quaternion; q and -q agree."""
    sign = 1.0 if q[0] >= 0.0 else -1.0
    sine = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    scale = 2.0 * sign if sine < _SMALL_ANGLE else 2.0 * sign * math.atan2(sine, sign * q[0]) / sine
    out = np.empty(3)
    out[0], out[1], out[2] = scale * q[1], scale * q[2], scale * q[3]
    return out


@compiled
def quaternion_to_matrix(q: Array) -> Array:
    """Return R_wb of the unit quaternion q_wb."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    out = np.empty((3, 3))
    out[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    out[0, 1] = 2.0 * (x * y - w * z)
    out[0, 2] = 2.0 * (x * z + w * y)
    out[1, 0] = 2.0 * (x * y + w * z)
    out[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    out[1, 2] = 2.0 * (y * z - w * x)
    out[2, 0] = 2.0 * (x * z - w * y)
    out[2, 1] = 2.0 * (y * z + w * x)
    out[2, 2] = 1.0 - 2.0 * (x * x + y * y)
    return out


@compiled
def quaternion_from_matrix(R: Array) -> Array:
    """Return the unit quaternion (w >= 0) of R_wb, by the largest pivot (Shepperd 1978)."""
    out = np.empty(4)
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace >= R[0, 0] and trace >= R[1, 1] and trace >= R[2, 2]:
        out[0] = 1.0 + trace
        out[1] = R[2, 1] - R[1, 2]
        out[2] = R[0, 2] - R[2, 0]
        out[3] = R[1, 0] - R[0, 1]
    elif R[0, 0] >= R[1, 1] and R[0, 0] >= R[2, 2]:
        out[0] = R[2, 1] - R[1, 2]
        out[1] = 1.0 + 2.0 * R[0, 0] - trace
        out[2] = R[0, 1] + R[1, 0]
        out[3] = R[0, 2] + R[2, 0]
    elif R[1, 1] >= R[2, 2]:
        out[0] = R[0, 2] - R[2, 0]
        out[1] = R[0, 1] + R[1, 0]
        out[2] = 1.0 + 2.0 * R[1, 1] - trace
        out[3] = R[1, 2] + R[2, 1]
    else:
        out[0] = R[1, 0] - R[0, 1]
        out[1] = R[0, 2] + R[2, 0]
        out[2] = R[1, 2] + R[2, 1]
        out[3] = 1.0 + 2.0 * R[2, 2] - trace
    length = norm(out)
    if out[0] < 0.0:
        length = -length
    for i in range(4):
        out[i] /= length
    return out


@compiled
def rotate(q: Array, v: Array) -> Array:
    """Return R_wb v: a body vector in world axes."""
    # v + 2 w (u x v) + 2 u x (u x v), with u the vector part: no matrix needed.
    tx = 2.0 * (q[2] * v[2] - q[3] * v[1])
    ty = 2.0 * (q[3] * v[0] - q[1] * v[2])
    tz = 2.0 * (q[1] * v[1] - q[2] * v[0])
    out = np.empty(3)
    out[0] = v[0] + q[0] * tx + q[2] * tz - q[3] * ty
    out[1] = v[1] + q[0] * ty + q[3] * tx - q[1] * tz
    out[2] = v[2] + q[0] * tz + q[1] * ty - q[2] * tx
    return out


@compiled
def rotate_inverse(q: Array, v: Array) -> Array:
    """Return R_wb^T v: a world vector in body axes."""
    return rotate(quaternion_conjugate(q), v)


@compiled
def rotation_exp(phi: Array) -> Array:
    """Return the SO(3) exponential of the rotation vector phi (rad)."""
    return quaternion_to_matrix(quaternion_exp(phi))


@compiled
def rotation_log(R: Array) -> Array:
    """Return the rotation vector (rad) of R, length <= pi."""
    return quaternion_log(quaternion_from_matrix(R))


@compiled
def yaw_of(q: Array) -> float:
    """Return the ZYX yaw (rad, -pi..pi) of q_wb."""
    return math.atan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]))


@compiled
def quaternion_from_euler(roll: float, pitch: float, yaw: float) -> Array:
    """Return q_wb of ZYX Euler angles (rad)."""
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    out = np.empty(4)
    out[0] = cr * cp * cy + sr * sp * sy
    out[1] = sr * cp * cy - cr * sp * sy
    out[2] = cr * sp * cy + sr * cp * sy
    out[3] = cr * cp * sy - sr * sp * cy
    return out


@compiled
def euler_from_quaternion(q: Array) -> Array:
    """Return (roll, pitch, yaw) in rad, ZYX, of q_wb."""
    out = np.empty(3)
    out[0] = math.atan2(2.0 * (q[0] * q[1] + q[2] * q[3]), 1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2]))
    out[1] = math.asin(min(1.0, max(-1.0, 2.0 * (q[0] * q[2] - q[3] * q[1]))))
    out[2] = yaw_of(q)
    return out


@compiled
def wrap_angle(angle: float) -> float:
    """Return the angle (rad) wrapped to -pi..pi."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
