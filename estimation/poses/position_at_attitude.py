"""Position from one frame of bearings with a given attitude, such as a filter's (Sec. 6.2).

Gyroscopes hold the attitude far better than one frame of bearings determines it. With the attitude
given, only the position is unknown, and three bearings, generally two, suffice.

With x = R_wb bearing, d the unit vector from the position r to the beacon and rho their distance,
the residual is x - d. A move of r changes it by P / rho, P = I - d d^T, hence J^T J = sum P / rho^2
and J^T e = sum (x - (x . d) d) / rho: only the components perpendicular to the ray count.
"""

from __future__ import annotations

import math

from quadrotor.compiled import compiled
from quadrotor.records import Array
from quadrotor.vectors import (
    Vector,
    add,
    along,
    axes_of,
    dot,
    length,
    normalized,
    quaternion,
    scale,
    store,
    subtract,
    to_world,
    vector,
)

MAX_STEPS = 10
"""Most Gauss-Newton steps; two or three suffice from a filter's position."""
MAX_MOVE = 0.5
"""Largest step, as a share of the mean distance to the beacons."""
SETTLED = 1e-12
"""Limit in rad^2 per beacon: a step that is predicted to lower the cost by less is the last."""
UNSEEN = 1e-12
"""Determinant of the information over its cubed trace below which no position is determined."""
NEAREST = 1e-6
"""Smallest distance used, m: a bearing to a beacon at this place has no information."""


@compiled(inner=True)
def symmetric_inverse(
    a: float, b: float, c: float, d: float, e: float, f: float
) -> tuple[Vector, Vector, Vector, float]:
    """Return rows of the inverse of ((a, b, c), (b, d, e), (c, e, f)), and its determinant."""
    p, q, s = d * f - e * e, c * e - b * f, b * e - c * d
    det = a * p + b * q + c * s
    w = 1.0 / det
    t, u, v = w * (a * f - c * c), w * (b * c - a * e), w * (a * d - b * b)
    p, q, s = w * p, w * q, w * s
    return (p, q, s), (q, t, u), (s, u, v), det


@compiled
def position_at_attitude(
    beacons_w: Array, bearings_b: Array, quaternion_wb: Array, start_w: Array, out: Array
) -> float:
    """Write the position that explains the bearings best at this attitude into `out` (3,) m, and
    return the cost.

    Args:
        beacons_w: (N, 3) m, world; any N >= 2 beacons that are not in line with the position.
        bearings_b: (N, 3) unit vectors in body axes, same order.
        quaternion_wb: (4,) body to world, of any length above 0.
        start_w: (3,) m, start of the search, such as a filter's position; `out` may be the same
            array.

    Returns the cost, the sum of squared angles (chords) between measured and predicted bearings,
    rad^2. It is NaN when the input is not finite or the bearings do not determine a position; `out`
    is then `start_w`.
    """
    axes = axes_of(normalized(quaternion(quaternion_wb)))
    start = vector(start_w)
    r, kept, step = start, start, (0.0, 0.0, 0.0)
    cost = math.inf
    for _ in range(MAX_STEPS):
        trial, promise, to, clamp = _step(beacons_w, bearings_b, axes, r)
        if trial <= cost:
            kept, step, cost = r, scale(clamp, to), trial
            if promise <= SETTLED * len(beacons_w):
                break
        elif trial > cost:
            step = scale(0.5, step)
        else:
            cost, kept = math.nan, start
            break
        r = add(kept, step)
    store(kept, out)
    return cost


@compiled(inner=True)
def position_covariance(beacons_w: Array, position_w: Array, sigma: float, out: Array) -> bool:
    """Write the covariance (3, 3) m^2, world axes, of a position at a known attitude into `out`:
    sigma^2 (J^T J)^-1.

    Args:
        beacons_w: (N, 3) m.
        position_w: (3,) m.
        sigma: rad on each of two tangent axes.

    An error of the given attitude is not included. Returns False when the bearings do not determine
    a position; `out` is then unchanged.
    """
    r = vector(position_w)
    xx = xy = xz = yy = yz = zz = 0.0
    for k in range(len(beacons_w)):
        ray = subtract(vector(beacons_w[k]), r)
        w = 1.0 / max(dot(ray, ray), NEAREST * NEAREST)
        d = scale(math.sqrt(w), ray)
        xx, xy, xz = xx + w * (1.0 - d[0] * d[0]), xy - w * d[0] * d[1], xz - w * d[0] * d[2]
        yy, yz = yy + w * (1.0 - d[1] * d[1]), yz - w * d[1] * d[2]
        zz += w * (1.0 - d[2] * d[2])
    row_x, row_y, row_z, det = symmetric_inverse(xx, xy, xz, yy, yz, zz)
    if not det > UNSEEN * (xx + yy + zz) ** 3:
        return False
    variance = sigma * sigma
    store(scale(variance, row_x), out[0])
    store(scale(variance, row_y), out[1])
    store(scale(variance, row_z), out[2])
    return True


@compiled(inner=True)
def _step(
    beacons_w: Array, bearings_b: Array, axes: tuple[Vector, Vector, Vector], r: Vector
) -> tuple[float, float, Vector, float]:
    """Return cost at r, its predicted reduction by the step, the step, and its clamp (<= 1)."""
    xx = xy = xz = yy = yz = zz = 0.0
    g = (0.0, 0.0, 0.0)
    cost = total = 0.0
    count = len(beacons_w)
    for k in range(count):
        x = to_world(axes, vector(bearings_b[k]))
        ray = subtract(vector(beacons_w[k]), r)
        rho = max(length(ray), NEAREST)
        s = 1.0 / rho
        d = scale(s, ray)
        e = subtract(x, d)
        cost += dot(e, e)
        total += rho
        g = along(g, s, along(x, -dot(x, d), d))
        w = s * s
        xx, xy, xz = xx + w * (1.0 - d[0] * d[0]), xy - w * d[0] * d[1], xz - w * d[0] * d[2]
        yy, yz = yy + w * (1.0 - d[1] * d[1]), yz - w * d[1] * d[2]
        zz += w * (1.0 - d[2] * d[2])
    row_x, row_y, row_z, det = symmetric_inverse(xx, xy, xz, yy, yz, zz)
    if not det > UNSEEN * (xx + yy + zz) ** 3:
        cost = math.nan
    step = (-dot(row_x, g), -dot(row_y, g), -dot(row_z, g))
    clamp = min(1.0, MAX_MOVE * total / count / length(step))
    return cost, -dot(step, g), step, clamp
