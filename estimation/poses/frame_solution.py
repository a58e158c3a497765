"""The solution of one frame of bearings in compiled code: start, refinement, and its faults."""

from __future__ import annotations

import math

from estimation.poses.bearing_frame import ATTITUDE, CENTER, POSITION, SIGHTS, store_right
from estimation.poses.bearing_refinement import refine
from estimation.poses.homography import homography_pose
from quadrotor.compiled import compiled
from quadrotor.records import Array
from quadrotor.vectors import add, length, normalized, quaternion, scale, store, subtract, vector

FALSE_REFUSAL = 1e-7
"""Probability that noise of the stated size makes the fit of a true pose look wrong."""
_NORMAL = 5.1993
"""Deviations that a Gaussian exceeds with that probability, on one side."""
PLAUSIBLE = 2.0
"""Residual in sigma up to which a fit from a prediction is accepted; above it, others are tried
too."""
LIKELY = 2.0
"""Deviations of the cost above its mean, beyond which other fours of more than four beacons are
tried: the first led to a wrong minimum, or the noise is among the largest 4 %."""
MAX_STEPS = 12
"""Most Gauss-Newton steps; two suffice, except low above a beacon (1 in 3000 of the envelope)."""
UNIT = 0.01
"""Largest deviation of a bearing's length from 1."""

SOLVED, SHAPE, NOT_FINITE, NOT_UNIT, BAD_SIGMA = 0, 1, 2, 3, 4
BAD_PREDICTION, NO_START, UNSEEN, NO_FIT, DOUBTFUL = 5, 6, 7, 8, 9
"""Results of `solve_frame`; the pose is written for SOLVED and DOUBTFUL."""


@compiled(inner=True)
def chi_square(freedom: float) -> float:
    """Return the chi-square that this many degrees exceed with probability FALSE_REFUSAL at most.

    By Wilson and Hilferty's cube: 36.1 where 32.2 is exact for 2 degrees, 53.9 for 52.3 for 10.
    """
    spread = 2.0 / (9.0 * freedom)
    cube = 1.0 - spread + _NORMAL * math.sqrt(spread)
    return freedom * cube * cube * cube


@compiled
def solve_frame(bearings_b: Array, frame: Array, sigma: float) -> int:
    """Write the pose into `frame` (13 + N, 6), see `bearing_frame`; return the result code.

    Args:
        bearings_b: (N, 3) unit vectors, body axes.
        sigma: rad on each of two tangent axes.
    """
    count = len(frame) - SIGHTS
    if len(bearings_b) != count or bearings_b.shape[1] != 3:
        return SHAPE
    if not 0.0 < sigma < math.inf:
        return BAD_SIGMA
    worst = 0.0
    for k in range(count):
        x = vector(bearings_b[k])
        size = length(x)
        if not size < math.inf:
            return NOT_FINITE
        worst = max(worst, abs(size - 1.0))
        store_right(scale(1.0 / size, x), frame[SIGHTS + k])
    if worst > UNIT:
        return NOT_UNIT
    center = vector(frame[CENTER])
    r, q = vector(frame[POSITION]), quaternion(frame[ATTITUDE])
    first = 1
    if frame[ATTITUDE, 5] > 0.0:
        first = 0
        r, q = subtract(r, center), normalized(q)
        if not length(r) + abs(q[0]) < math.inf:
            return BAD_PREDICTION
    enough = 2.0 * count * (PLAUSIBLE * sigma) ** 2
    code, best, cost, kept_r, kept_q = NO_START, -1, math.inf, r, q
    # From the prediction, from the homography, and back to the first if that was the better one.
    for attempt in range(first, 3):
        steps = int(frame[ATTITUDE, 4])
        if attempt == 1:
            started, r, q = homography_pose(frame)
            if not started:
                continue
        elif attempt == 2:
            if best != 0:
                break
            r, q, steps = kept_r, kept_q, 0
        seen, trial, r, q = refine(frame, r, q, sigma, steps)
        if seen and trial <= cost:
            best, cost, kept_r, kept_q = attempt, trial, r, q
            if trial < enough:
                break
        elif not seen and best < 0:
            code = UNSEEN
    if best < 0:
        return code
    residual = math.sqrt(cost / count)
    frame[POSITION, 3] = residual
    freedom = 2.0 * count - 6.0
    if not cost < chi_square(freedom) * sigma * sigma:
        return NO_FIT
    store(add(kept_r, center), frame[POSITION])
    sign = math.copysign(1.0, kept_q[0])
    for i in range(4):
        frame[ATTITUDE, i] = sign * kept_q[i]
    for i in range(6):
        for j in range(6):
            frame[i, j] *= sigma * sigma
    likely = freedom + LIKELY * math.sqrt(2.0 * freedom)
    return DOUBTFUL if count > 4 and cost > likely * sigma * sigma else SOLVED
