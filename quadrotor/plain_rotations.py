"""Rotations without numba, whose import takes seconds: for the station, the page and for logs.

Single rotations are plain floats, many are numpy arrays of N rows; `quadrotor.rotations` has the
compiled ones of the flight process. Quaternions are (w, x, y, z), body to world
(docs/conventions.md).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]
Rows = tuple[Any, Any, Any]


def rows_of(q: Sequence[Any] | Array) -> tuple[Rows, Rows, Rows]:
    """Return the three rows of R_wb.

    Args:
        q: w, x, y, z of a unit quaternion, four floats or four columns (N,).
    """
    w, x, y, z = q
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def rotate(q: Sequence[Any] | Array, v: Sequence[Any] | Array) -> tuple[Any, Any, Any]:
    """Return R_wb v, a body vector in world axes.

    Args:
        q: w, x, y, z of a unit quaternion, four floats or four columns (N,).
        v: three floats or three columns (N,).
    """
    w, x, y, z = q
    tx, ty, tz = (2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0]))
    return (
        v[0] + w * tx + y * tz - z * ty,
        v[1] + w * ty + z * tx - x * tz,
        v[2] + w * tz + x * ty - y * tx,
    )


def roll_pitch_yaw(w: float, x: float, y: float, z: float) -> Triple:
    """Return the ZYX Euler angles (rad) of a unit quaternion."""
    return (
        math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        math.asin(min(1.0, max(-1.0, 2.0 * (w * y - z * x)))),
        math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def roll_pitch_yaw_of_rows(quaternion_wb: npt.NDArray[np.floating]) -> Array:
    """Return the ZYX Euler angles (rad), shape (N, 3), of unit quaternions (N, 4)."""
    w, x, y, z = quaternion_wb.T
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.stack([roll, pitch, yaw], axis=1)


def rotation_vectors_between(
    estimated_wb: npt.NDArray[np.floating], true_wb: npt.NDArray[np.floating]
) -> Array:
    """Return the rotation vectors (rad, world axes) from estimated to true attitudes.

    Args:
        estimated_wb, true_wb: unit quaternions, shape (N, 4).

    Returns:
        Shape (N, 3), of lengths up to pi.
    """
    scalar, vector = np.split(product_of(true_wb, conjugate(estimated_wb)), [1], axis=1)
    sine = np.linalg.norm(vector, axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, np.abs(scalar)) * np.where(scalar < 0.0, -1.0, 1.0)
    scale = np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0)
    found: Array = vector * scale
    return found


def make_continuous(quaternion: npt.NDArray[np.floating]) -> None:
    """Give neighbouring quaternions (N, 4) the same sign, in place, so that they can be
    interpolated.
    """
    flips = np.einsum("nk,nk->n", quaternion[1:], quaternion[:-1]) < 0.0
    if flips.any():
        quaternion[np.concatenate([[0], np.cumsum(flips)]) % 2 == 1] *= -1.0


def product_of(one: npt.NDArray[np.floating], other: npt.NDArray[np.floating]) -> Array:
    """Return the products of quaternions, (N, 4); either may have one row."""
    a, b, c, d = one.T
    w, x, y, z = other.T
    scalar = a * w - b * x - c * y - d * z
    i = a * x + b * w + c * z - d * y
    j = a * y - b * z + c * w + d * x
    k = a * z + b * y - c * x + d * w
    return np.stack([scalar, i, j, k], axis=1)


def conjugate(quaternions: npt.NDArray[np.floating]) -> Array:
    """Return the inverse rotations, (N, 4)."""
    found: Array = quaternions * np.array([1.0, -1.0, -1.0, -1.0])
    return found


def matrix_of(q: Array) -> Array:
    """Return R_wb of a unit quaternion, shape (3, 3)."""
    return np.array(rows_of(q.tolist()))


def matrices_of(q: Array) -> Array:
    """Return R_wb (N, 3, 3) of unit quaternions (N, 4)."""
    return np.moveaxis(np.array(rows_of(q.T)), 2, 0)


def tilt_of(w: float, x: float, y: float, z: float) -> float:
    """Return the angle (rad) between z_B and z_W of a unit quaternion."""
    return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))


def quaternion_of(x: float, y: float, z: float) -> Quadruple:
    """Return the unit quaternion of a rotation vector (rad)."""
    half = 0.5 * math.sqrt(x * x + y * y + z * z)
    share = 0.5 * math.sin(half) / half if half > 1e-8 else 0.5
    return math.cos(half), share * x, share * y, share * z


def turned(q: Array, rotation_vector_b: Sequence[float]) -> Array:
    """Return q ⊗ exp(rotation vector), shape (4,): q rotated by that vector (rad), body axes."""
    # Plain floats: for four numbers, numpy's calls cost more than the arithmetic.
    pw, px, py, pz = quaternion_of(*rotation_vector_b)
    w, x, y, z = q.tolist()
    r = w * pw - x * px - y * py - z * pz
    s = w * px + x * pw + y * pz - z * py
    t = w * py - x * pz + y * pw + z * px
    u = w * pz + x * py - y * px + z * pw
    length = math.sqrt(r * r + s * s + t * t + u * u)
    return np.array((r / length, s / length, t / length, u / length))
