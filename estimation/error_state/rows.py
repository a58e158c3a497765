"""Linearised measurements: one row per measured number, with respect to the six pose errors.

A bearing x_b to a beacon at c, seen from p: with d the unit vector of c - p, rho its length and x =
R x_b, the residual is the tangent vector at d that leads to x; its length is the angle. With a
position error dp and an attitude error phi (R_true = exp(phi) R) it is

    e = -(I - d d^T) dp / rho + d x phi + noise,   sigma on each tangent axis,

so along a tangent axis t the row is (-t / rho, t x d). There is no division by a depth: bearings
may point anywhere. For a pose, e = (p_m - p, log(R_m R^T)) and the rows are those of the identity.
The angle at which a plane of light met a sensor at p + R l has the row (g, R l x g), where g is the
angle's gradient with respect to the sensor's position; the position of a marker at p + R l has such
a row for each axis g of the world. A reading of a sensor of the user's own brings its row.
"""

from __future__ import annotations

import math

from estimation.error_state.memory import (
    ATTITUDE,
    BEARING,
    MARKER,
    PLANE_ROWS,
    POSE,
    POSE_ERRORS,
    POSITION,
    READING,
    SWEEPS,
)
from estimation.sweep_angles import swept
from quadrotor.compiled import compiled
from quadrotor.records import Array, Item
from quadrotor.vectors import (
    Vector,
    add,
    axes_of,
    cross,
    dot,
    length,
    multiply,
    scale,
    subtract,
    to_world,
    vector,
)

NEAREST = 0.05
"""Distance in m below which the direction to a beacon is not used."""


@compiled(inner=True)
def linearize(m: Item, slot: int, x: Array, g: Item) -> int:
    """Write row, rest and variance of an event at the nominal state x (16,); return the number of
    pairs.
    """
    rows, rest, variance, data = m.row, m.rest, m.variance, m.event_data[slot]
    if m.event_kind[slot] == POSE:
        turn = turn_to(data[1], x)
        for i in range(6):
            for j in range(6):
                rows[i, j] = 1.0 if i == j else 0.0
            rest[i] = data[0, i] - x[i] if i < 3 else turn[i - 3]
            sigma = g.pose_position_sigma if i < 3 else g.pose_attitude_sigma
            variance[i] = m.noise_scale[POSITION if i < 3 else ATTITUDE] * sigma * sigma
        return 3
    if m.event_kind[slot] == SWEEPS:
        return linearize_sweeps(m, slot, x, g)
    if m.event_kind[slot] == MARKER:
        return linearize_marker(m, slot, x, g)
    if m.event_kind[slot] == READING:
        return linearize_reading(m, slot, x)
    sigma = max(m.event_sigma[slot], g.bearing_sigma_floor) * math.sqrt(m.noise_scale[BEARING])
    axes = axes_of((x[6], x[7], x[8], x[9]))
    for k in range(m.event_beacons[slot]):
        away = subtract(vector(data[k]), vector(x))
        distance = max(length(away), 1e-9)
        d = scale(1.0 / distance, away)
        seen = to_world(axes, vector(data[k, 3:]))
        along = dot(seen, d)
        e = subtract(seen, scale(along, d))
        sine = length(e)
        e = scale(math.atan2(sine, along) / sine if sine > 1e-9 else 1.0, e)
        # Any tangent axes work; these are those of Duff et al. (JCGT 2017), well conditioned
        # everywhere.
        sign = math.copysign(1.0, d[2])
        a = -1.0 / (sign + d[2])
        t = (1.0 + sign * d[0] * d[0] * a, sign * d[0] * d[1] * a, -sign * d[0])
        for i in range(2):
            turn = cross(t, d)
            row = rows[2 * k + i]
            for j in range(3):
                row[j], row[3 + j] = -t[j] / distance, turn[j]
            rest[2 * k + i] = dot(t, e)
            variance[2 * k + i] = sigma * sigma if distance > NEAREST else math.inf
            t = turn
    return int(m.event_beacons[slot])


@compiled(inner=True)
def turn_to(quaternion: Array, x: Array) -> Vector:
    """Return the turn (rad, world axes) from the attitude of a nominal state x to another one."""
    error = multiply(
        (quaternion[0], quaternion[1], quaternion[2], quaternion[3]), (x[6], -x[7], -x[8], -x[9])
    )
    turn = (error[1], error[2], error[3])
    sine = length(turn)
    angle = 2.0 * math.atan2(math.copysign(sine, error[0]), abs(error[0]))
    return scale(angle / sine if sine > 1e-9 else 2.0, turn)


@compiled(inner=True)
def linearize_reading(m: Item, slot: int, x: Array) -> int:
    """Write row, rest and variance of a reading, paired with an empty row; return 1.

    What is expected is linear about the pose at which it was linearised.
    """
    data = m.event_data[slot]
    turn, row = turn_to(data[1], x), data[2]
    m.rest[0], m.rest[1] = data[0, 3], 0.0
    m.variance[0], m.variance[1] = m.event_sigma[slot] ** 2, 1.0
    for i in range(3):
        m.rest[0] += row[i] * (data[0, i] - x[i]) + row[3 + i] * turn[i]
    for i in range(POSE_ERRORS):
        m.row[0, i], m.row[1, i] = row[i], 0.0
    return 1


@compiled(inner=True)
def linearize_marker(m: Item, slot: int, x: Array, g: Item) -> int:
    """Write row, rest and variance of a marker's position; return the number of pairs.

    The last number is paired with an empty row; the rest of an attitude is 0, for runs.
    """
    lever = to_world(axes_of((x[6], x[7], x[8], x[9])), (g.marker_x, g.marker_y, g.marker_z))
    for i in range(POSE_ERRORS):
        row = m.row[i]
        m.variance[i], m.rest[i] = 1.0, 0.0
        for j in range(POSE_ERRORS):
            row[j] = 0.0
        if i < 3:
            row[i] = 1.0
            turn = cross(lever, vector(row))
            row[3], row[4], row[5] = turn
            m.rest[i] = m.event_data[slot][0, i] - x[i] - lever[i]
            m.variance[i] = m.noise_scale[POSITION] * g.pose_position_sigma * g.pose_position_sigma
    return 2


@compiled(inner=True)
def linearize_sweeps(m: Item, slot: int, x: Array, g: Item) -> int:
    """Write row, rest and variance of the sensors that one plane met, two per pair; return the
    number of pairs.

    What place and calibration of the base station leave unexplained is common to the angles of one
    plane. Their mean, which has it, and their differences, which do not, are independent: the first
    row is the angles' sum over the root of their number, the others compare each angle with those
    before it. The last of an odd number is paired with an empty row.
    """
    data, axes = m.event_data[slot], axes_of((x[6], x[7], x[8], x[9]))
    count = m.event_beacons[slot] - PLANE_ROWS
    variance = m.noise_scale[BEARING] * m.event_sigma[slot] ** 2
    pairs = (count + 1) // 2
    for i in range(6 * PLANE_ROWS):
        m.plane[i] = data[i // 6, i % 6]
    for k in range(2 * pairs):
        row = m.row[k]
        m.variance[k], m.rest[k] = variance, 0.0
        for j in range(6):
            row[j] = 0.0
        if k == count:
            break
        sensor = data[PLANE_ROWS + k]
        lever = to_world(axes, vector(sensor))
        angle, gradient = swept(m.plane, add(vector(x), lever))
        turn = cross(lever, gradient)
        past = sensor[3] - angle + math.pi
        m.rest[k] = past - 2.0 * math.pi * math.floor(past / (2.0 * math.pi)) - math.pi
        for j in range(3):
            row[j], row[3 + j] = gradient[j], turn[j]
    compare(m, count)
    m.variance[0] += m.noise_scale[BEARING] * count * g.sweep_plane_sigma**2
    return int(pairs)


@compiled(inner=True)
def compare(m: Item, count: int) -> None:
    """Replace rests and rows of `count` numbers by their sum and by their differences, of the same
    variance (Helmert's transformation).
    """
    for j in range(POSE_ERRORS + 1):
        total = 0.0
        for k in range(count):
            value = m.rest[k] if j == POSE_ERRORS else m.row[k, j]
            difference = (total - k * value) / math.sqrt(k * (k + 1.0)) if k > 0 else 0.0
            total += value
            if j == POSE_ERRORS:
                m.rest[k] = difference
            else:
                m.row[k, j] = difference
        if j == POSE_ERRORS:
            m.rest[0] = total / math.sqrt(count)
        else:
            m.row[0, j] = total / math.sqrt(count)
