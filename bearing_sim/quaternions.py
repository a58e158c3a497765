"""The few rotations needed here, in floats: `quadrotor.rotations` is compiled, which the base
station's process must not wait for. Quaternions are (w, x, y, z), body to world.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]


def rows_of(q: Quadruple) -> tuple[Triple, Triple, Triple]:
    """Return the rows of R_wb of a unit quaternion."""
    w, x, y, z = q
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def matrix_of(q: Array) -> Array:
    """Return R_wb of a unit quaternion, shape (3, 3)."""
    w, x, y, z = q.tolist()
    return np.array(rows_of((w, x, y, z)))


def quaternion_of(x: float, y: float, z: float) -> Quadruple:
    """Return the unit quaternion of a rotation vector, rad."""
    half = 0.5 * math.sqrt(x * x + y * y + z * z)
    share = 0.5 * math.sin(half) / half if half > 1e-8 else 0.5
    return math.cos(half), share * x, share * y, share * z


def turned(q: Array, rotation_vector_b: Sequence[float]) -> Array:
    """Return q ⊗ exp(rotation vector), shape (4,): turned by that vector (rad) about body axes."""
    # Plain floats: on four numbers, numpy's calls cost more than the arithmetic.
    pw, px, py, pz = quaternion_of(*rotation_vector_b)
    w, x, y, z = q.tolist()
    r = w * pw - x * px - y * py - z * pz
    s = w * px + x * pw + y * pz - z * py
    t = w * py - x * pz + y * pw + z * px
    u = w * pz + x * py - y * px + z * pw
    length = math.sqrt(r * r + s * s + t * t + u * u)
    return np.array((r / length, s / length, t / length, u / length))
