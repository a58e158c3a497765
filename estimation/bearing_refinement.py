"""Gauss-Newton refinement of a pose on the bearings themselves, in compiled loops.

In world axes, with x = R_wb bearing, d the unit vector from r to the beacon and rho their
distance, the residual of a beacon is x - d, a chord: monotone over the whole sphere. A rotation
R <- exp(phi) R changes it by -[x] phi, a move of r by (I - d d^T) / rho.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.rotations import norm, quaternion_to_matrix, rotation_exp

Array = npt.NDArray[np.float64]

MAX_STEPS = 12
"""Gauss-Newton steps; two do, except low above a beacon (1 in 3000 of the envelope)."""
SETTLED = 0.02
"""Share of the cost a step must take off to be followed by another."""
MAX_MOVE = 0.5
"""Largest step, as a share of the mean distance to the beacons."""
MAX_TURN = 0.5
"""Largest step, rad."""


@compiled
def normalize(beacons: Array, bearings: Array, unit: Array) -> float:
    """Bearings (N, 3) at length 1 into unit (N, 3); the length that was farthest from 1.

    Not finite when a number of the beacons (N, 3) or bearings is not.
    """
    worst, total = 1.0, 0.0
    for k in range(bearings.shape[0]):
        length = norm(bearings[k])
        if not abs(length - 1.0) <= abs(worst - 1.0):
            worst = length
        for i in range(3):
            unit[k, i] = bearings[k, i] / length
            # Times 0, so that finite numbers leave nothing behind and others NaN.
            total += 0.0 * beacons[k, i] + 0.0 * bearings[k, i]
    return worst + total


@compiled
def linearize(
    beacons: Array, bearings: Array, r: Array, R: Array, gradient: Array, information: Array
) -> tuple[float, float]:
    """Sum of squared residuals and mean distance (m); J^T e into gradient (6,), J^T J (6, 6).

    Args:
        beacons: (N, 3) m, world. bearings: (N, 3) unit, body. r: (3,) m. R: (3, 3) R_wb.
    """
    gradient[:] = 0.0
    information[:] = 0.0
    row = np.empty(6)
    d, x = np.empty(3), np.empty(3)
    cost, total = 0.0, 0.0
    for k in range(beacons.shape[0]):
        rho = 0.0
        for i in range(3):
            d[i] = beacons[k, i] - r[i]
            rho += d[i] * d[i]
            x[i] = R[i, 0] * bearings[k, 0] + R[i, 1] * bearings[k, 1] + R[i, 2] * bearings[k, 2]
        rho = max(math.sqrt(rho), 1e-9)
        total += rho
        for i in range(3):
            d[i] /= rho
        for i in range(3):
            j, m = (i + 1) % 3, (i + 2) % 3
            for c in range(3):
                row[c] = -d[i] * d[c] / rho
            row[i] += 1.0 / rho
            row[3 + i], row[3 + j], row[3 + m] = 0.0, x[m], -x[j]
            e = x[i] - d[i]
            cost += e * e
            for a in range(6):
                gradient[a] += row[a] * e
                for b in range(6):
                    information[a, b] += row[a] * row[b]
    return cost, total / beacons.shape[0]


@compiled
def solve(information: Array, gradient: Array, step: Array) -> bool:
    """-information^-1 gradient into step (6,), by Cholesky; False when it is not positive."""
    L = np.zeros((6, 6))
    for i in range(6):
        for j in range(i + 1):
            total = information[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i == j:
                if not total > 1e-14 * information[i, i]:
                    return False
                L[i, i] = math.sqrt(total)
            else:
                L[i, j] = total / L[j, j]
    for i in range(6):
        total = -gradient[i]
        for k in range(i):
            total -= L[i, k] * step[k]
        step[i] = total / L[i, i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            step[i] -= L[k, i] * step[k]
        step[i] /= L[i, i]
    return True


@compiled
def refine(beacons: Array, bearings: Array, r: Array, R: Array, information: Array) -> float:
    """Moves r (3,) and R (3, 3) in place to the best pose near them; the cost left (rad^2).

    Steps are clamped; one that does not lower the cost is halved, at most three times.
    `information` (6, 6), for sigma 1, is written for the pose found.
    """
    gradient, step, trial_r = np.empty(6), np.empty(6), np.empty(3)
    trial_gradient, trial_information = np.empty(6), np.empty((6, 6))
    cost, distance = linearize(beacons, bearings, r, R, gradient, information)
    for _ in range(MAX_STEPS):
        before = cost
        if not solve(information, gradient, step):
            break  # no direction is better: the caller finds the pose unobserved
        move = math.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
        turn = math.sqrt(step[3] ** 2 + step[4] ** 2 + step[5] ** 2)
        share = 1.0 / max(1.0, move / (MAX_MOVE * distance), turn / MAX_TURN)
        for _ in range(4):
            for i in range(3):
                trial_r[i] = r[i] + share * step[i]
            turned = rotation_exp(share * step[3:])
            trial_R = np.empty((3, 3))
            for i in range(3):
                for j in range(3):
                    trial_R[i, j] = (
                        turned[i, 0] * R[0, j] + turned[i, 1] * R[1, j] + turned[i, 2] * R[2, j]
                    )
            trial, trial_distance = linearize(
                beacons, bearings, trial_r, trial_R, trial_gradient, trial_information
            )
            if trial < cost:
                r[:], R[:], gradient[:] = trial_r, trial_R, trial_gradient
                information[:] = trial_information
                cost, distance = trial, trial_distance
                break
            share *= 0.5
        if before - cost <= SETTLED * before:
            break
    return cost


@compiled
def refine_from(
    beacons: Array, bearings: Array, r: Array, q: Array, R: Array, information: Array
) -> float:
    """As `refine`, from an attitude q (4,) of any length; R (3, 3) is written only."""
    length = norm(q)
    unit = np.empty(4)
    for i in range(4):
        unit[i] = q[i] / length
    R[:] = quaternion_to_matrix(unit)
    return refine(beacons, bearings, r, R, information)


@compiled
def invert(information: Array, extent: float, out: Array) -> float:
    """information^-1 into out (6, 6), by Cholesky; smallest over largest squared pivot.

    The ratio, taken with positions in shares of `extent` (m), is near 0 when some motion changes
    none of the bearings; then `out` is not to be used.
    """
    L, inverse = np.zeros((6, 6)), np.zeros((6, 6))
    smallest, largest = math.inf, 0.0
    for i in range(6):
        for j in range(i + 1):
            total = information[i, j] * (extent if i < 3 else 1.0) * (extent if j < 3 else 1.0)
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i == j:
                smallest, largest = min(smallest, total), max(largest, total)
                if not total > 0.0:
                    return 0.0
                L[i, i] = math.sqrt(total)
            else:
                L[i, j] = total / L[j, j]
    for c in range(6):
        for i in range(c, 6):
            total = 1.0 if i == c else 0.0
            for k in range(c, i):
                total -= L[i, k] * inverse[k, c]
            inverse[i, c] = total / L[i, i]
    for i in range(6):
        for j in range(6):
            total = 0.0
            for k in range(max(i, j), 6):
                total += inverse[k, i] * inverse[k, j]
            out[i, j] = total * (extent if i < 3 else 1.0) * (extent if j < 3 else 1.0)
    return smallest / largest
