"""The gate: the weight of a measurement by its distance from the prediction.

Up to `gate` deviations a measurement is used as it is. Beyond, its variance is raised so that its
effect on the estimate decreases with distance, and beyond FAR times the gate it is refused. The
prior may be overconfident, so the gate opens with the time since a measurement was last used, and
refused poses are compared with each other: a lost filter restarts from a run of them that agree.
"""

from __future__ import annotations

import math

from estimation.error_state.memory import ERRORS, POSE_ERRORS
from quadrotor.compiled import compiled
from quadrotor.records import Array, Item

FAR, FAR_BEARINGS = 2.0, 1.0
"""Multiples of the gate, in deviations, beyond which a pose or a bearing is refused. A frame of
bearings gives a new start by itself, and angles are never as many deviations off as positions:
bearings are refused at the gate."""
OPEN_AFTER, OPEN_WITHIN = 0.1, 0.2
"""Seconds without a used pose after which the gate opens, and seconds for each further multiple of
its width, up to FAR times."""
RUN_LEAST = 4
"""Number of refused poses that have to agree with each other for a start from them."""
RUN_GAP = 0.5
"""Longest time, in s, between two poses of a run."""
RUN_SPEED, RUN_RATE = 10.0, 3.0
"""Fastest motion, m/s and rad/s, of a lost estimate relative to the poses."""
RUN_DEVIATIONS = 6.0
"""Largest deviations of two poses of a run from each other, in addition to speed and rate."""


@compiled(inner=True)
def project(P: Array, row: Array, out: Array) -> float:
    """Compute out (15,) = P[:, :6] row, with the symmetric P (15, 15), and return row . out."""
    total = 0.0
    for i in range(ERRORS):
        out[i] = 0.0
    for j in range(POSE_ERRORS):
        for i in range(ERRORS):
            out[i] += row[j] * P[j, i]
    for j in range(POSE_ERRORS):
        total += row[j] * out[j]
    return total


@compiled(inner=True)
def along(row: Array, error: Array) -> float:
    """Return the product row (6,) . error (n,)."""
    total = 0.0
    for j in range(POSE_ERRORS):
        total += row[j] * error[j]
    return total


@compiled(inner=True)
def chi_square(deviations: float) -> float:
    """Return the approximate chi-square of two degrees that is as improbable as this many
    deviations of a Gaussian.
    """
    cube = 8.0 / 9.0 + deviations / 3.0
    return 2.0 * cube * cube * cube


@compiled(inner=True)
def gate(m: Item, pairs: int, whole: bool, deviations: float) -> int:
    """Mark in `used` the pairs of rows that the prior allows, and return their number; write
    `distance`, `far`, `expected` and `doubt`.

    Args:
        whole: whether to use all pairs or none, with the weight of the farthest of them.
        deviations: of the gate.
    """
    P, gain = m.prior, m.gain
    waited = 1e-9 * (m.base_ns - m.measurement_ns)
    most = FAR if whole else FAR_BEARINGS
    deviations *= min(1.0 + max(0.0, waited - OPEN_AFTER) / OPEN_WITHIN, most)
    near, far = chi_square(deviations), chi_square(most * deviations)
    m.far = far
    count, farthest = 0, 0.0
    for k in range(pairs):
        a = project(P, m.row[2 * k], gain[0]) + m.variance[2 * k]
        c = project(P, m.row[2 * k + 1], gain[1]) + m.variance[2 * k + 1]
        b = along(m.row[2 * k + 1], gain[0])
        p, q = m.rest[2 * k], m.rest[2 * k + 1]
        distance = (c * p * p - 2.0 * b * p * q + a * q * q) / (a * c - b * b)
        m.distance[k] = distance
        m.used[k] = 1 if distance < far else 0  # NaN is not
        farthest = max(farthest, distance)
        count += m.used[k]
        m.expected[2 * k], m.expected[2 * k + 1] = a, c
    for k in range(pairs):
        excess = ((farthest if whole else m.distance[k]) / near) ** 2 - 1.0
        for i in (2 * k, 2 * k + 1):
            m.doubt[i] = m.expected[i] * max(0.0, excess)
    if whole and count < pairs:
        for k in range(pairs):
            m.used[k] = 0
        return 0
    return count


@compiled(inner=True)
def run(m: Item, refused: bool) -> None:
    """Compare a pose that was just linearised with the run of refused ones that agree."""
    if not refused:
        m.run_count = 0
        return
    t = 1e-9 * (m.base_ns - m.run_ns)
    agrees = m.run_count > 0 and t <= RUN_GAP
    for first, speed in ((0, RUN_SPEED), (3, RUN_RATE)):
        apart, variance = 0.0, 0.0
        for i in range(first, first + 3):
            apart += (m.rest[i] - m.run_last[i]) ** 2
            variance += 2.0 * m.variance[i]
        agrees = agrees and apart < (RUN_DEVIATIONS * math.sqrt(variance) + speed * t) ** 2
    m.run_count = m.run_count + 1 if agrees else 1
    if m.run_count == 1:
        m.run_start_ns = m.base_ns
    m.run_ns = m.base_ns
    for i in range(POSE_ERRORS):
        m.run_last[i] = m.rest[i]
        if m.run_count == 1:
            m.run_first[i] = m.rest[i]
