"""Gauss-Newton refinement of a pose on the bearings themselves, in compiled scalars.

In world axes, with x = R_wb bearing, d the unit vector from r to the beacon and rho their distance,
the residual of a beacon is e = x - d, a chord, which is monotone over the whole sphere. A move of r
changes it by P / rho, P = I - d d^T, a rotation R <- exp(phi) R by -[x]. With v = d x x,

    J^T J = [ sum P / rho^2      B       ]     J^T e = [ sum (x - (x . d) d) / rho ]
            [     B^T       sum I - x x^T ]             [ sum v                     ]

with B = sum (d v^T - [x]) / rho. It is solved by the Schur complement of the rotation's block, with
both 3 x 3 inverses in closed form. Rotations are stepped by Cayley's map, which is exp to third
order.
"""

from __future__ import annotations

import math

from estimation.poses.bearing_frame import SIGHTS, right, store_right
from estimation.poses.position_at_attitude import symmetric_inverse
from quadrotor.compiled import compiled
from quadrotor.records import Array
from quadrotor.vectors import (
    Quaternion,
    Vector,
    add,
    along,
    axes_of,
    cross,
    dot,
    length,
    multiply,
    normalized,
    scale,
    store,
    subtract,
    to_world,
    vector,
)

Rows = tuple[Vector, Vector, Vector]

MAX_MOVE = 0.5
"""Largest step, as a share of the mean distance to the beacons."""
MAX_TURN = 0.5
"""Largest step, rad."""
SETTLED = 0.1
"""Limit in sigma: a step that is predicted to lower the cost by less than its square is
the last."""
UNSEEN = 1e-12
"""Share of the information below which only rounding errors remain."""
NEAR = 2.0
"""Distance in deviations of the position. The distance to a nearer beacon, and perhaps the side
from which it is seen, is unknown: its information is no longer linear, and is overestimated."""
NEAREST = 1e-9
"""Smallest distance used, m."""


@compiled(inner=True)
def refine(
    frame: Array, r: Vector, q: Quaternion, sigma: float, steps: int
) -> tuple[bool, float, Vector, Quaternion]:
    """Return whether the pose is determined, the cost (rad^2), and r and q_wb of the best pose near
    (r, q).

    Steps are clamped; one that raises the cost is halved.

    Args:
        frame: (13 + N, 6), see `bearing_frame`. Its first six rows are written: (J^T J)^-1 at the
            final pose (for sigma 1), with the correction for beacons within NEAR.
        r: m, from the plane's centre.
        q: unit.
        sigma: rad, the size of the noise, for the stopping rule.
        steps: maximum number of steps; 0 evaluates the given pose.
    """
    move, turn = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    kept_r, kept_q, cost = r, q, math.inf
    enough = (SETTLED * sigma) ** 2
    determined = False
    none = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    S, E, F = none, none, none
    for _ in range(steps + 1):
        trial, distance, A, B, D, g_r, g_phi = normal_equations(frame, r, q)
        if not trial <= cost:
            move, turn = scale(0.5, move), scale(0.5, turn)
        else:
            kept_r, kept_q, cost = r, q, trial
            determined, S, E, F = inverse(A, B, D)
            if not determined:
                break
            g = subtract(apply(E, g_phi), g_r)
            move = apply(S, g)
            turn = scale(-1.0, add(apply(F, g_phi), transposed(E, move)))
            promise = -dot(move, g_r) - dot(turn, g_phi)
            if promise <= enough and steps > 0:
                kept_r, kept_q = add(r, move), tilted(q, turn)
                cost = max(0.0, cost - promise)
                break
            s = 1.0 / max(1.0, length(move) / (MAX_MOVE * distance), length(turn) / MAX_TURN)
            move, turn = scale(s, move), scale(s, turn)
        r, q = add(kept_r, move), tilted(kept_q, turn)
    if determined:  # at the newest accepted pose, whatever the later steps gave
        blur2 = sigma * sigma * (S[0][0] + S[1][1] + S[2][2])
        if nearest2(frame, kept_r) < NEAR * NEAR * blur2:
            _, _, A, B, D, _, _ = normal_equations(frame, kept_r, kept_q, blur2)
            determined, S, E, F = inverse(A, B, D)
        store_inverse(S, E, F, frame)
    return determined, cost, kept_r, kept_q


@compiled(inner=True)
def normal_equations(
    frame: Array, r: Vector, q: Quaternion, blur2: float = 0.0
) -> tuple[float, float, tuple[Vector, Vector], Rows, tuple[Vector, Vector], Vector, Vector]:
    """Return cost (rad^2), mean distance (m), blocks of J^T J and parts of J^T e; see the module.

    Symmetric blocks are returned as ((xx, yy, zz), (xy, xz, yz)). The information of bearings about
    the position is computed for distances enlarged by the variance blur2 (m^2).
    """
    axes = axes_of(q)
    zero = (0.0, 0.0, 0.0)
    cost = total = w = 0.0
    dd, dc, xx, xc = zero, zero, zero, zero
    B_x, B_y, B_z, lever = zero, zero, zero, zero
    g_r, g_phi = zero, zero
    count = len(frame) - SIGHTS
    for k in range(count):
        x = to_world(axes, right(frame[SIGHTS + k]))
        ray = subtract(vector(frame[SIGHTS + k]), r)
        rho = max(length(ray), NEAREST)
        s = 1.0 / rho
        d = scale(s, ray)
        if blur2 > 0.0:
            s = 1.0 / math.sqrt(rho * rho + blur2)
        v = cross(d, x)
        e = subtract(x, d)
        cost += dot(e, e)
        total += rho
        w += s * s
        h = scale(s, d)
        dd = add(dd, (h[0] * h[0], h[1] * h[1], h[2] * h[2]))
        dc = add(dc, (h[0] * h[1], h[0] * h[2], h[1] * h[2]))
        xx = add(xx, (x[0] * x[0], x[1] * x[1], x[2] * x[2]))
        xc = add(xc, (x[0] * x[1], x[0] * x[2], x[1] * x[2]))
        B_x, B_y, B_z = along(B_x, h[0], v), along(B_y, h[1], v), along(B_z, h[2], v)
        lever = along(lever, s, x)
        g_r = add(g_r, along(scale(s, x), -dot(x, d), h))
        g_phi = add(g_phi, v)
    A = (subtract((w, w, w), dd), scale(-1.0, dc))
    D = (subtract((1.0 * count, 1.0 * count, 1.0 * count), xx), scale(-1.0, xc))
    B = (
        add(B_x, (0.0, lever[2], -lever[1])),
        add(B_y, (-lever[2], 0.0, lever[0])),
        add(B_z, (lever[1], -lever[0], 0.0)),
    )
    return cost, total / count, A, B, D, g_r, g_phi


@compiled(inner=True)
def nearest2(frame: Array, r: Vector) -> float:
    """Return the squared distance (m^2) to the nearest beacon."""
    least = math.inf
    for k in range(len(frame) - SIGHTS):
        ray = subtract(vector(frame[SIGHTS + k]), r)
        least = min(least, dot(ray, ray))
    return least


@compiled(inner=True)
def inverse(
    A: tuple[Vector, Vector], B: Rows, D: tuple[Vector, Vector]
) -> tuple[bool, Rows, Rows, Rows]:
    """Return whether [A B; B^T D] has an inverse, the inverse of S = A - B D^-1 B^T, E = B D^-1,
    and D^-1.
    """
    (xx, yy, zz), (xy, xz, yz) = D
    D_x, D_y, D_z, det = symmetric_inverse(xx, xy, xz, yy, yz, zz)
    seen = det > UNSEEN * (xx + yy + zz) ** 3
    D_inverse = (D_x, D_y, D_z)
    E = (apply(D_inverse, B[0]), apply(D_inverse, B[1]), apply(D_inverse, B[2]))
    (xx, yy, zz), (xy, xz, yz) = A
    sx, sy, sz = xx - dot(E[0], B[0]), yy - dot(E[1], B[1]), zz - dot(E[2], B[2])
    S_x, S_y, S_z, det = symmetric_inverse(
        sx, xy - dot(E[0], B[1]), xz - dot(E[0], B[2]), sy, yz - dot(E[1], B[2]), sz
    )
    seen = seen and min(sx, sy, sz) > UNSEEN * (xx + yy + zz)
    seen = seen and det > UNSEEN * (sx + sy + sz) ** 3
    return seen, (S_x, S_y, S_z), E, D_inverse


@compiled(inner=True)
def store_inverse(S: Rows, E: Rows, D: Rows, out: Array) -> None:
    """Store [S, -S E; -E^T S, D + E^T S E], from the results of `inverse`, in the first rows of
    out.
    """
    X = (transposed(E, S[0]), transposed(E, S[1]), transposed(E, S[2]))
    for i in range(3):
        store(S[i], out[i])
        store_right(scale(-1.0, X[i]), out[i])
        below = (X[0][i], X[1][i], X[2][i])
        store(scale(-1.0, below), out[3 + i])
        store_right(add(D[i], transposed(E, below)), out[3 + i])


@compiled(inner=True)
def apply(rows: Rows, v: Vector) -> Vector:
    """Return the product of the matrix with these rows and v."""
    return dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)


@compiled(inner=True)
def transposed(rows: Rows, v: Vector) -> Vector:
    """Return the product of the transposed matrix and v."""
    return add(add(scale(v[0], rows[0]), scale(v[1], rows[1])), scale(v[2], rows[2]))


@compiled(inner=True)
def tilted(q: Quaternion, phi: Vector) -> Quaternion:
    """Return q turned about world axes by phi (rad), by Cayley's map."""
    return normalized(multiply((1.0, 0.5 * phi[0], 0.5 * phi[1], 0.5 * phi[2]), q))
