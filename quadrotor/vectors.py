"""Vectors and quaternions as tuples: the arithmetic of the compiled laws.

A tuple of floats stays in registers: nothing is allocated, and a law reads like its equation.
Vectors are (x, y, z), quaternions (w, x, y, z) of unit length, body to world. An attitude in use
is the triple of its columns (x_b, y_b, z_b), the body's axes in world axes.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled

Array = npt.NDArray[np.float64]
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Axes = tuple[Vector, Vector, Vector]


@compiled(inner=True)
def vector(a: Array) -> Vector:
    """Return the first three numbers of an array."""
    return a[0], a[1], a[2]


@compiled(inner=True)
def quaternion(a: Array) -> Quaternion:
    """Return the first four numbers of an array."""
    return a[0], a[1], a[2], a[3]


@compiled(inner=True)
def store(v: Vector, out: Array) -> None:
    """Store v in the first three numbers of an array."""
    out[0], out[1], out[2] = v


@compiled(inner=True)
def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled(inner=True)
def subtract(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled(inner=True)
def scale(s: float, a: Vector) -> Vector:
    """Return s a."""
    return s * a[0], s * a[1], s * a[2]


@compiled(inner=True)
def times(a: Vector, b: Vector) -> Vector:
    """Return the componentwise product: a diagonal matrix times a vector."""
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@compiled(inner=True)
def along(a: Vector, s: float, b: Vector) -> Vector:
    """Return a + s b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@compiled(inner=True)
def dot(a: Vector, b: Vector) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled(inner=True)
def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@compiled(inner=True)
def length(a: Vector) -> float:
    """Return |a|."""
    return math.sqrt(dot(a, a))


@compiled(inner=True)
def to_world(axes: Axes, v_b: Vector) -> Vector:
    """Return R_wb v_b."""
    x, y, z = axes
    return (
        x[0] * v_b[0] + y[0] * v_b[1] + z[0] * v_b[2],
        x[1] * v_b[0] + y[1] * v_b[1] + z[1] * v_b[2],
        x[2] * v_b[0] + y[2] * v_b[1] + z[2] * v_b[2],
    )


@compiled(inner=True)
def to_body(axes: Axes, v_w: Vector) -> Vector:
    """Return R_wb^T v_w."""
    return dot(axes[0], v_w), dot(axes[1], v_w), dot(axes[2], v_w)


@compiled(inner=True)
def axes_of(q: Quaternion) -> Axes:
    """Return the columns of R_wb for a unit quaternion q_wb."""
    w, x, y, z = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@compiled(inner=True)
def multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return the Hamilton product p (x) q."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + q[0] * p[1] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] + q[0] * p[2] + p[3] * q[1] - p[1] * q[3],
        p[0] * q[3] + q[0] * p[3] + p[1] * q[2] - p[2] * q[1],
    )


@compiled(inner=True)
def turned(q: Quaternion, phi: Vector) -> Quaternion:
    """Return q (x) exp(phi): q rotated by the rotation vector phi (rad) in body axes."""
    half = 0.5 * length(phi)
    s = 0.5 * (math.sin(half) / half if half > 1e-9 else 1.0)
    return multiply(q, (math.cos(half), s * phi[0], s * phi[1], s * phi[2]))


@compiled(inner=True)
def normalized(q: Quaternion) -> Quaternion:
    """Return q scaled to length 1."""
    s = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return s * q[0], s * q[1], s * q[2], s * q[3]
