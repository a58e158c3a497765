"""A flat curve that winds outwards, one metre above the floor: a trajectory made by a program.

Copy this file into the folder the vehicle loads its trajectories from; it is then flown by
`follow_trajectory` with trajectory = file, file = spiral. It is run once, when it is loaded.
Needed are `duration` (s) and `sample(t, reference)`, which fills position to snap and yaw to yaw
acceleration, at rest at both ends.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from quadrotor.records import Record

DURATION = 20.0  # s
RADIUS = 1.0  # m at the end
TURNS = 2.0

# From 0 to 1 over the flight, four derivatives zero at both ends.
SHARE = Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])


class Spiral:
    """x + i y = RADIUS share exp(2 pi i TURNS share), with its derivatives by Leibniz' rule."""

    duration = DURATION

    def sample(self, t: float, reference: Record) -> None:
        tau = min(1.0, max(0.0, t / DURATION))
        share = [SHARE.deriv(k)(tau) if k else SHARE(tau) for k in range(5)]
        turn = [2j * np.pi * TURNS * s for s in share]
        around = [np.exp(turn[0])]
        for k in range(1, 5):  # e' = turn' e, differentiated again and again
            terms = [_binomial(k - 1, j) * turn[j + 1] * around[k - 1 - j] for j in range(k)]
            around.append(sum(terms))
        for k, name in enumerate(("position", "velocity", "acceleration", "jerk", "snap")):
            place = sum(_binomial(k, j) * share[j] * around[k - j] for j in range(k + 1))
            place = RADIUS * place / DURATION**k
            reference[f"{name}_w"] = (place.real, place.imag, 0.0 if k else 1.0)
        reference["yaw"], reference["yaw_rate"], reference["yaw_acceleration"] = 0.0, 0.0, 0.0


def _binomial(n: int, k: int) -> int:
    return [[1], [1, 1], [1, 2, 1], [1, 3, 3, 1], [1, 4, 6, 4, 1]][n][k]


trajectory = Spiral
