"""The model of the predictive law: its reference over the horizon, its step and derivatives."""

from __future__ import annotations

import math

from control.desired_attitude import axes_of_force
from control.geometric_law import DIRECTION_MIN
from extensions.laws.pid_cascade import canonical, conjugate, quaternion_of
from quadrotor.compiled import compiled
from quadrotor.records import Array, Item
from quadrotor.vectors import Quaternion, Vector, axes_of, multiply, normalized, quaternion, turned
from quadrotor.vehicle_model import GRAVITY

NODES, STATES, INPUTS = 20, 9, 4


@compiled(inner=True)
def look_ahead(m: Item, reference: Item, model: Item, h: float) -> None:
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
        force = (
            a[0] + t * (j[0] + t / 2 * s[0]) + d * at[3],
            a[1] + t * (j[1] + t / 2 * s[1]) + d * at[4],
            max(DIRECTION_MIN * GRAVITY, a[2] + t * (j[2] + t / 2 * s[2]) + d * at[5] + GRAVITY),
        )
        yaw = reference.yaw + t * (reference.yaw_rate + t / 2 * reference.yaw_acceleration)
        q = quaternion_of(axes_of_force(force, yaw))
        for i in range(4):
            at[6 + i] = q[i]
        if k < NODES:
            m.u_r[k, 0] = math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
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
def advance(x: Array, u: Array, d: float, h: float, out: Array) -> None:
    """Write the next state of the model."""
    q = quaternion(x[6:])
    z = axes_of(q)[2]
    for i in range(3):
        a = u[0] * z[i] - d * x[3 + i] - (GRAVITY if i == 2 else 0.0)
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
def linearize(m: Item, k: int, d: float, h: float) -> None:
    """Write A and B of the error about the trajectory at node k."""
    A, B, x, u = m.A, m.B, m.x[k], m.u[k]
    axes = axes_of(quaternion(x[6:]))
    for i in range(STATES):
        for j in range(STATES):
            A[i, j] = 1.0 if i == j else 0.0
        for j in range(INPUTS):
            B[i, j] = 0.0
    for i in range(3):
        A[i, 3 + i] = h - 0.5 * h * h * d
        A[3 + i, 3 + i] = 1.0 - h * d
        by_x, by_y = -u[0] * axes[1][i], u[0] * axes[0][i]
        A[i, 6], A[i, 7] = 0.5 * h * h * by_x, 0.5 * h * h * by_y
        A[3 + i, 6], A[3 + i, 7] = h * by_x, h * by_y
        B[i, 0], B[3 + i, 0] = 0.5 * h * h * axes[2][i], h * axes[2][i]
    # dtheta+ = exp(-h omega) dtheta + J_r(h omega) h domega, J_r to second order
    back = axes_of(turned((1.0, 0.0, 0.0, 0.0), (-h * u[1], -h * u[2], -h * u[3])))
    w = h * u[1], h * u[2], h * u[3]
    square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    for j in range(3):
        for i in range(3):
            A[6 + i, 6 + j] = back[j][i]
            B[6 + i, 1 + j] = h * (w[i] * w[j] / 6.0 + (1.0 - square / 6.0 if i == j else 0.0))
    for i, j, s in ((0, 1, w[2]), (1, 2, w[0]), (2, 0, w[1])):
        B[6 + i, 1 + j] += 0.5 * h * s
        B[6 + j, 1 + i] -= 0.5 * h * s
