"""The few rotations needed here, in numpy: `quadrotor.rotations` is compiled, which the base
station's process must not wait for. Quaternions are (w, x, y, z), body to world.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def matrix_of(q: Array) -> Array:
    """R_wb of a unit quaternion, shape (3, 3)."""
    w, x, y, z = (float(v) for v in q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def turned(q: Array, rotation_vector_b: Array) -> Array:
    """q ⊗ exp(rotation vector), shape (4,): turned by that vector (rad) about body axes."""
    half = 0.5 * rotation_vector_b
    angle = float(np.sqrt(half @ half))
    # sinc(x) of numpy is sin(pi x)/(pi x): exact at zero.
    px, py, pz = (float(v) for v in half * np.sinc(angle / np.pi))
    pw = float(np.cos(angle))
    w, x, y, z = (float(v) for v in q)
    product = np.array(
        [
            w * pw - x * px - y * py - z * pz,
            w * px + x * pw + y * pz - z * py,
            w * py - x * pz + y * pw + z * px,
            w * pz + x * py - y * px + z * pw,
        ]
    )
    return np.asarray(product / np.sqrt(product @ product))
