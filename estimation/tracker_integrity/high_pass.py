"""A high-pass of second order on an increment at each pose, for steps of any length.

It is an observer with a double pole, so that an unknown start and a constant rate are forgotten.
The first three numbers of its memory are its output, the last three the rate that it assumes.
"""

from __future__ import annotations

import math

from quadrotor.compiled import compiled
from quadrotor.records import Array
from quadrotor.vectors import Vector, add, along, vector


@compiled(inner=True)
def passed(memory: Array, increment: Vector, since: float) -> Vector:
    """Return the output after an increment in `since` (s), without keeping it."""
    return add(along(vector(memory), since, vector(memory[3:])), increment)


@compiled(inner=True)
def keep(memory: Array, output: Vector, kick: Vector, since: float, rate: float) -> None:
    """Keep the output that `passed` returned.

    Args:
        kick: change of the increments' rate since the last one, where that is known.
        rate: of the double pole, rad/s.
    """
    pole = math.exp(-rate * since)
    gain, rate_gain = 1.0 - pole * pole, (1.0 - pole) ** 2 / since
    for i in range(3):
        memory[i] = (1.0 - gain) * output[i]
        memory[3 + i] += kick[i] - rate_gain * output[i]
