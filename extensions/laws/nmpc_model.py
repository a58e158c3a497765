"""The model of the predictive law: its reference over the horizon, its step and derivatives."""

from __future__ import annotations

import math

from control.desired_attitude import axes_of_force
from control.geometric_law import DIRECTION_MIN
from extensions.laws.pid_cascade import canonical, conjugate, quaternion_of
from quadrotor.compiled import compiled
from quadrotor.records import Array, Item
from quadrotor.vectors import (
    Quaternion,
    Vector,
    axes_of,
    multiply,
    normalized,
    quaternion,
    scale,
    turned,
)
from quadrotor.vehicle_model import GRAVITY

NODES, STATES, INPUTS = 20, 9, 4
Push = tuple[float, float, float, float]
"""m/s^2: what the model lacks along z_B, and across it in world axes."""


@compiled(inner=True)
def look_ahead(m: Item, reference: Item, model: Item, push: Push, h: float) -> None:
    """Write x_r and u_r of all nodes."""
    p, v, a = reference.position_w, reference.velocity_w, reference.acceleration_w
    j, s = reference.jerk_w, reference.snap_w
    d = model.drag / model.mass
    for k in range(NODES + 1):
        t = k * h
        at = m.x_r[k]
        for i in range(3):
            at[i] = p[i] + t * (v[i] + t / 2 * (a[i] + t / 3 * (j[i] + t / 4 * s[i])))
            at[3 + i] = v[i] + t * (a[i] + t / 2 * (j[i] + t / 3 * s[i]))
        up = a[2] + t * (j[2] + t / 2 * s[2]) + d * at[5] + GRAVITY
        force = (
            a[0] + t * (j[0] + t / 2 * s[0]) + d * at[3] - push[1],
            a[1] + t * (j[1] + t / 2 * s[1]) + d * at[4] - push[2],
            max(DIRECTION_MIN * GRAVITY, up - push[3]),
        )
        yaw = reference.yaw + t * (reference.yaw_rate + t / 2 * reference.yaw_acceleration)
        q = quaternion_of(axes_of_force(force, yaw))
        for i in range(4):
            at[6 + i] = q[i]
        if k < NODES:
            m.u_r[k, 0] = math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2) - push[0]
    for k in range(NODES):
        now, then = quaternion(m.x_r[k, 6:]), quaternion(m.x_r[k + 1, 6:])
        turn = rotation_vector(multiply(conjugate(now), then))
        for i in range(3):
            m.u_r[k, 1 + i] = turn[i] / h


@compiled(inner=True)
def rotation_vector(q: Quaternion) -> Vector:
    """Return the rotation (rad) of a unit quaternion."""
    w, x, y, z = canonical(q)
    size = math.sqrt(x * x + y * y + z * z)
    k = 2.0 * math.atan2(size, w) / size if size > 1e-12 else 2.0
    return k * x, k * y, k * z


@compiled(inner=True)
def advance(x: Array, u: Array, push: Push, d: float, h: float, out: Array) -> None:
    """Write the next state of the model, with the thrust along z_B of the interval's middle."""
    q = quaternion(x[6:])
    z = axes_of(turned(q, (0.5 * h * u[1], 0.5 * h * u[2], 0.5 * h * u[3])))[2]
    for i in range(3):
        a = (u[0] + push[0]) * z[i] + push[1 + i] - d * x[3 + i] - (GRAVITY if i == 2 else 0.0)
        out[i] = x[i] + h * x[3 + i] + 0.5 * h * h * a
        out[3 + i] = x[3 + i] + h * a
    then = normalized(turned(q, (h * u[1], h * u[2], h * u[3])))
    for i in range(4):
        out[6 + i] = then[i]


@compiled(inner=True)
def difference(x: Array, y: Array, out: Array) -> None:
    """Write the error (dp, dv, dtheta) that leads from y to x."""
    for i in range(6):
        out[i] = x[i] - y[i]
    turn = rotation_vector(multiply(conjugate(quaternion(y[6:])), quaternion(x[6:])))
    for i in range(3):
        out[6 + i] = turn[i]


@compiled(inner=True)
def turn_jacobian(w: Vector) -> tuple[Vector, Vector, Vector]:
    """Return the rows of J_r(w), to second order: exp(w + dw) = exp(w) exp(J_r dw)."""
    x, y, z = w
    k = 1.0 - (x * x + y * y + z * z) / 6.0
    return (
        (k + x * x / 6.0, x * y / 6.0 + 0.5 * z, x * z / 6.0 - 0.5 * y),
        (x * y / 6.0 - 0.5 * z, k + y * y / 6.0, y * z / 6.0 + 0.5 * x),
        (x * z / 6.0 + 0.5 * y, y * z / 6.0 - 0.5 * x, k + z * z / 6.0),
    )


@compiled(inner=True)
def linearize(m: Item, k: int, lift: float, d: float, h: float) -> None:
    """Write A and B of the error about the trajectory at node k."""
    A, B, x, u = m.A, m.B, m.x[k], m.u[k]
    w = h * u[1], h * u[2], h * u[3]
    half = 0.5 * w[0], 0.5 * w[1], 0.5 * w[2]
    middle = axes_of(turned(quaternion(x[6:]), half))
    # dtheta+ = exp(-w) dtheta + J_r(w) dw, and in the middle with half of w
    one = 1.0, 0.0, 0.0, 0.0
    back = axes_of(turned(one, scale(-1.0, w)))
    half_back = axes_of(turned(one, scale(-1.0, half)))
    spread, half_spread, thrust = turn_jacobian(w), turn_jacobian(half), u[0] + lift
    for i in range(STATES):
        for j in range(STATES):
            A[i, j] = 1.0 if i == j else 0.0
        for j in range(INPUTS):
            B[i, j] = 0.0
    for i in range(3):
        A[i, 3 + i] = h - 0.5 * h * h * d
        A[3 + i, 3 + i] = 1.0 - h * d
        B[3 + i, 0] = h * middle[2][i]
        for j in range(3):
            by_turn = half_back[j][1] * middle[0][i] - half_back[j][0] * middle[1][i]
            by_rate = half_spread[1][j] * middle[0][i] - half_spread[0][j] * middle[1][i]
            A[3 + i, 6 + j] = h * thrust * by_turn
            B[3 + i, 1 + j] = 0.5 * h * h * thrust * by_rate
            A[6 + i, 6 + j] = back[j][i]
            B[6 + i, 1 + j] = h * spread[i][j]
        for j in range(3):
            A[i, 6 + j] = 0.5 * h * A[3 + i, 6 + j]
        for j in range(INPUTS):
            B[i, j] = 0.5 * h * B[3 + i, j]
