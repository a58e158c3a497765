"""Measurement update: scalar by scalar, iterated about the most probable pose.

The rows of a measurement are independent, so each is a scalar update with innovation nu and
variance s = h P h^T + r: P is reduced by (P h)(P h)^T / s, which is symmetric to the last bit. When
the correction bends the bearings by more than their linearisation allows, as at low height above a
beacon, the update restarts from the prior with the measurement linearised at the new pose (the
iterated filter, which is Gauss-Newton on prior and measurement together).
"""

from __future__ import annotations

import math

from estimation.error_state.adaptation import learn_from_bearings, learn_from_pose
from estimation.error_state.gate import along, gate, project, run
from estimation.error_state.memory import (
    ERRORS,
    MARKER,
    NOMINAL,
    NOTHING,
    POSE,
    POSE_ERRORS,
    READING,
    SWEEPS,
)
from estimation.error_state.rows import linearize
from quadrotor.compiled import compiled
from quadrotor.records import Array, Item
from quadrotor.vectors import Vector, add, cross, dot, multiply, normalized, scale, turned, vector

MAX_STEPS = 6
STRAIGHT = 0.02
"""Angle in rad; bearings moved by less need no new linearisation."""
MEMORY = 0.05
"""Weight of the newest measurement in the mean consistency, and in the refused share."""
SINGLE = 10.0
"""Largest contribution of a single measurement to the mean consistency."""
LOST_REFUSALS = 8
"""Number of refused measurements in a row that are no longer chance outliers."""
REFUSED_MAX = 0.5
"""Largest share of refused measurements, lately, of a consistent filter."""
AT_ONCE_NS = 200_000_000
"""Time in ns between the last used measurement and the first refused one; within it the
measurements jumped, otherwise the estimate drifted."""
FIT_UPDATES = 10
FIT_CONSISTENCY = 3.0
"""Measurements since the start, and their mean consistency, for a filter to be fit."""
BROAD = 0.5
"""Prior deviation in m and rad of a reported innovation: what the bearings of one frame leave open
stays small."""


@compiled(inner=True)
def displace(x: Array, error: Array, out: Array) -> None:
    """Write out (16,) = nominal state x (16,) corrected by an error (15,)."""
    phi = turned((1.0, 0.0, 0.0, 0.0), (error[3], error[4], error[5]))
    q = normalized(multiply(phi, (x[6], x[7], x[8], x[9])))
    for i in range(3):
        out[i], out[3 + i] = x[i] + error[i], x[3 + i] + error[6 + i]
    out[6], out[7], out[8], out[9] = q
    for i in range(6):
        out[10 + i] = x[10 + i] + error[9 + i]


@compiled(inner=True)
def absorb(m: Item, pairs: int) -> float:
    """Make one pass of scalar updates from the prior, linearised at `step`, into `found`, and
    return the NIS.
    """
    P, prior, found, gain, row = m.covariance, m.prior, m.found, m.gain[0], m.row
    nis = 0.0
    for i in range(ERRORS):
        found[i] = 0.0
        for j in range(ERRORS):
            P[i, j] = prior[i, j]
    for k in range(2 * pairs):
        if m.used[k // 2]:
            s = project(P, row[k], gain) + m.variance[k] + m.doubt[k]
            nu = m.rest[k] + along(row[k], m.step) - along(row[k], found)
            nis += nu * nu / s
            for i in range(ERRORS):
                found[i] += gain[i] * nu / s
                for j in range(ERRORS):
                    P[i, j] -= gain[i] * gain[j] / s
    return nis


@compiled(inner=True)
def reset(P: Array, phi: Array) -> None:
    """Convert the covariance (15, 15) to that of the error that remains after the attitude was
    moved by phi (3,).

    exp(phi_true) exp(-phi) is exp(J (phi_true - phi)) with J = I + [phi] / 2 to first order.
    """
    half = (0.5 * phi[0], 0.5 * phi[1], 0.5 * phi[2])
    for _ in range(2):  # J P, transposed; twice is J P J^T
        for j in range(ERRORS):
            c = cross(half, (P[3, j], P[4, j], P[5, j]))
            for i in range(3):
                P[3 + i, j] += c[i]
        for i in range(1, ERRORS):
            for j in range(i):
                P[i, j], P[j, i] = P[j, i], P[i, j]


@compiled(inner=True)
def shift(m: Item, pairs: int, first: int, all_of_them: bool) -> Vector:
    """Return three pose errors, 0:3 (m) or 3:6 (rad), from bearings alone, assuming that the others
    are right.

    This is the most probable error for a prior of BROAD on each axis: components that the bearings
    leave open, as a single bearing does with the distance, stay near 0. Unlike the correction, it
    is not drawn to the filter's own covariance.
    """
    axx, ayy, azz = 1.0 / BROAD**2, 1.0 / BROAD**2, 1.0 / BROAD**2
    axy, axz, ayz = 0.0, 0.0, 0.0
    b = (0.0, 0.0, 0.0)
    for k in range(2 * pairs):
        if all_of_them or m.used[k // 2]:
            row, weight = vector(m.row[k, first:]), 1.0 / m.variance[k]
            x, y, z = row
            axx, ayy, azz = axx + weight * x * x, ayy + weight * y * y, azz + weight * z * z
            axy, axz, ayz = axy + weight * x * y, axz + weight * x * z, ayz + weight * y * z
            b = add(b, scale(weight * m.rest[k], row))
    one, two, three = (axx, axy, axz), (axy, ayy, ayz), (axz, ayz, azz)
    across = cross(two, three)
    whole = dot(one, across)  # Cramer's rule, A symmetric
    return (
        dot(b, across) / whole,
        dot(b, cross(three, one)) / whole,
        dot(b, cross(one, two)) / whole,
    )


@compiled(inner=True)
def tell_innovation(m: Item, pairs: int, kind: int, count: int) -> None:
    """Write `innovation` from the rows linearised at the prediction; from all rows when none was
    used.
    """
    if kind in (POSE, MARKER):
        for i in range(POSE_ERRORS):
            m.innovation[i] = m.rest[i]
        return
    move, turn = shift(m, pairs, 0, count == 0), shift(m, pairs, 3, count == 0)
    for i in range(3):
        m.innovation[i], m.innovation[3 + i] = move[i], turn[i]


@compiled(inner=True)
def believed(m: Item, pairs: int) -> int:
    """Return 1 when a pair of rows is used unchanged, within the gate; else 0."""
    for k in range(pairs):
        if m.used[k] and m.doubt[2 * k] == 0.0:
            return 1
    return 0


@compiled(inner=True)
def doubted(m: Item, pairs: int) -> float:
    """Return the chi-square of the used pairs beyond the gate, before their weight was reduced."""
    total = 0.0
    for k in range(pairs):
        if m.used[k] and m.doubt[2 * k] > 0.0:
            total += m.distance[k]
    return total


@compiled(inner=True)
def judge(m: Item, pairs: int, kind: int, count: int) -> None:
    """Evaluate the newest measurement, of which `count` pairs passed the gate.

    A frame most of whose bearings are refused counts as refused: one of four fits by chance
    wherever a lost filter is.
    """
    tell_innovation(m, pairs, kind, count)
    m.freedom, m.nis = min(2 * count, 3) if kind == MARKER else 2 * count, 0.0
    m.refused_share += MEMORY * (1.0 - count / pairs - m.refused_share)
    if m.refused_share <= REFUSED_MAX:
        m.contradicted_ns = 0
    elif m.contradicted_ns == 0:
        m.contradicted_ns = m.base_ns
    few = 2 * count < pairs
    if few and m.refused == 0:
        m.at_once = 1 if m.base_ns - m.measurement_ns < AT_ONCE_NS else 0
        m.refused_ns = m.base_ns
    m.believed = 0 if few else believed(m, pairs)
    if m.believed == 1:
        m.refused = 0
    elif few:
        m.refused += 1
    if kind in (POSE, MARKER):
        # a jump of the tracker shows nothing about the IMU
        learn_from_pose(m, kind == POSE, count > 0 or m.at_once == 0)
        run(m, count == 0)
    else:
        learn_from_bearings(m, pairs)


@compiled(inner=True)
def fuse(m: Item, slot: int, g: Item, newest: bool) -> bool:
    """Update base and covariance with one event at `base_ns`; return False when it was an outlier.

    Args:
        newest: whether it is the one that has just arrived and is evaluated. The others are only
            applied again, in their order.
    """
    P, x, step, found, kind = m.covariance, m.base, m.step, m.found, m.event_kind[slot]
    if kind == NOTHING:
        return True
    for i in range(ERRORS):
        step[i] = 0.0
        for j in range(ERRORS):
            m.prior[i, j] = P[i, j]
    pairs = linearize(m, slot, x, g)
    tracked = kind in (POSE, MARKER)
    count = gate(m, pairs, tracked or kind in (SWEEPS, READING), g.gate)
    judged = newest and kind != READING
    if judged:
        judge(m, pairs, kind, count)
    elif newest:
        m.reading[0], m.reading[1] = m.rest[0], math.sqrt(m.far * m.expected[0])
    if count == 0:
        return False
    for iteration in range(MAX_STEPS):
        nis = absorb(m, pairs)
        if judged and iteration == 0:
            m.nis = max(nis, doubted(m, pairs))
            m.applied += 1
            m.consistency += MEMORY * (min(m.nis / m.freedom, SINGLE) - m.consistency)
            if m.applied >= FIT_UPDATES and m.consistency < FIT_CONSISTENCY:
                m.restarted = 0
        bent = 0.0
        for i in range(ERRORS):
            step[i], found[i] = found[i], found[i] - step[i]
        for k in range(pairs):  # by pairs, so that the choice of tangent axes has no effect
            one, other = along(m.row[2 * k], found), along(m.row[2 * k + 1], found)
            bent = max(bent, one * one + other * other)
        displace(x, step, m.trial)
        if tracked or kind == READING or bent < STRAIGHT**2:
            break
        linearize(m, slot, m.trial, g)
    reset(P, step[3:])
    for i in range(NOMINAL):
        most = g.gyroscope_bias_limit if i < 13 else g.accelerometer_bias_limit
        x[i] = m.trial[i] if i < 10 else min(max(m.trial[i], -most), most)
    return True
