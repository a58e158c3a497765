"""Axes by their letters, and operations on quaternions of N rows."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from quadrotor.errors import UsageError
from quadrotor.records import Array

LETTERS = {
    **dict.fromkeys("FE", (1.0, 0.0, 0.0)),
    **dict.fromkeys("BW", (-1.0, 0.0, 0.0)),
    **dict.fromkeys("LN", (0.0, 1.0, 0.0)),
    **dict.fromkeys("RS", (0.0, -1.0, 0.0)),
    "U": (0.0, 0.0, 1.0),
    "D": (0.0, 0.0, -1.0),
}
"""Forward, left and up in a body; east, north and up in a world; and their opposites."""


def axes(letters: str, what: str) -> Array:
    """Return the matrix that transforms a vector with these axes into FLU or ENU, (3, 3).

    Raises UsageError when the letters are not right-handed axes.
    """
    if len(letters) == 3 and set(letters.upper()) <= set(LETTERS):
        matrix = np.array([LETTERS[one] for one in letters.upper()]).T
        if abs(np.linalg.det(matrix) - 1.0) < 1e-9:
            return matrix
    raise UsageError(
        f"{what} {letters!r}: three letters of right-handed axes are needed, like FLU or FRD of a "
        "body (forward, left, up, back, right, down), ENU or NED of a world"
    )


def bodies() -> list[str]:
    """Return the letters of all 24 right-handed body axes, the common ones first."""
    every = ("".join(one) for axes_ in permutations(("FB", "LR", "UD")) for one in product(*axes_))
    found = [one for one in every if np.linalg.det(np.array([LETTERS[k] for k in one]).T) > 0.0]
    return sorted(found, key=lambda one: ("FLU", "FRD").index(one) if one in ("FLU", "FRD") else 2)


def quaternion_of(matrix: Array) -> Array:
    """Return the quaternion of a rotation matrix, (1, 4)."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(matrix).as_quat()
    return np.array([[w, x, y, z]])
