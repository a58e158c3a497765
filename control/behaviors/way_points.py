"""Parse way-points from text."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.errors import OutOfBoundsError, WrongTypeError
from quadrotor.rotations import wrap_angle

COUNT_MAX = 12
"""Largest number of way-points, for which a path is found between two ticks."""

FARTHEST = 100.0
"""Largest absolute value, in m and rad: larger numbers are typing errors."""

CLOSEST = 1e-3
"""Distance, in m, below which neighbours with the same yaw are the same point."""

EXAMPLE = "give 'x y z yaw; x y z; ...' in m and rad"


def read_waypoints(text: str, start: tuple[float, float, float, float]) -> npt.NDArray[np.float64]:
    """Return (N + 1, 4): the start (m, rad) and the points of 'x y z yaw; x y z; ...'.

    Yaw is unwrapped. Raises WrongTypeError or OutOfBoundsError that names the point.
    """
    parts = [part for part in text.split(";") if part.strip()]
    if not 1 <= len(parts) <= COUNT_MAX:
        raise OutOfBoundsError(
            f"waypoints has {len(parts)} points; allowed 1 to {COUNT_MAX}: {EXAMPLE}"
        )
    points = [start]
    for number, part in enumerate(parts, start=1):
        where = f"waypoints, point {number}"
        words = part.replace(",", " ").split()
        if len(words) not in (3, 4):
            raise WrongTypeError(f"{where}: {len(words)} numbers in {part.strip()!r}; {EXAMPLE}")
        x, y, z, *turn = (_number(where, word) for word in words)
        before = points[-1]
        yaw = before[3] + (wrap_angle(turn[0] - before[3]) if turn else 0.0)
        if math.dist((x, y, z), before[:3]) < CLOSEST and abs(yaw - before[3]) < CLOSEST:
            raise OutOfBoundsError(
                f"{where} is where the one before it is ({part.strip()}); leave it out"
            )
        points.append((x, y, z, yaw))
    return np.array(points)


def _number(where: str, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        raise WrongTypeError(f"{where}: {word!r} is not a number; {EXAMPLE}") from None
    if not abs(value) <= FARTHEST:
        raise OutOfBoundsError(f"{where}: {word} is out of bounds; allowed ±{FARTHEST:g}")
    return value
