"""The model of the predictive law: its reference over the horizon, its step and derivatives."""

from __future__ import annotations

import math

from control.desired_attitude import attitude_of_force
from control.geometric_law import DIRECTION_MIN
from extensions.laws.pid_cascade import canonical, conjugate, quaternion_of
from quadrotor.compiled import compiled
from quadrotor.records import Array, Item
from quadrotor.vectors import (
    Quaternion,
    Vector,
    add,
    axes_of,
    cross,
    multiply,
    normalized,
    quaternion,
    scale,
    times,
    turned,
    vector,
)
from quadrotor.vehicle_model import GRAVITY, thrusts_of_wrench

NODES, STATES, INPUTS = 20, 12, 4
Push = tuple[float, float, float, float]
"""m/s^2: what the model lacks along z_B, and across it in world axes."""


@compiled(inner=True)
def harmonic(v: float, a: float, j: float, s: float, over: float) -> float:
    """Return the w^2 (1/s^2) of the harmonic motion nearest to the derivatives of an axis, or 0.

    j = -w^2 v and s = -w^2 a by least squares, with the second weighted by `over` (s^2).
    """
    size = v * v + over * a * a
    return max(0.0, -(v * j + over * a * s) / size) if size > 1e-12 else 0.0


@compiled(inner=True)
def continued(
    w2: float, v: float, a: float, j: float, s: float, t: float
) -> tuple[float, float, float, float, float]:
    """Return the way (m) from now to t (s), and velocity to snap there.

    What of jerk and snap is not harmonic is continued as a polynomial.
    """
    w = math.sqrt(w2)
    near = w * t < 1e-3
    sine = t if near else math.sin(w * t) / w
    versed = 0.5 * t * t if near else (1.0 - math.cos(w * t)) / w2
    cosine = math.cos(w * t)
    j, s = j + w2 * v, s + w2 * a
    velocity, acceleration = v * cosine + a * sine, a * cosine - w2 * v * sine
    return (
        v * sine + a * versed + t * t * t * (j / 6.0 + t * s / 24.0),
        velocity + t * t * (j / 2.0 + t * s / 6.0),
        acceleration + t * (j + t / 2.0 * s),
        -w2 * velocity + j + t * s,
        -w2 * acceleration + s,
    )


@compiled(inner=True)
def look_ahead(m: Item, reference: Item, model: Item, push: Push, spin: Vector, h: float) -> None:
    """Write x_r and u_r of all nodes, the first one the rotors' time constant from now.

    Args:
        spin: rad/s^2, what the model lacks of the angular acceleration.
    """
    p, v, a = reference.position_w, reference.velocity_w, reference.acceleration_w
    j, s = reference.jerk_w, reference.snap_w
    d, J = model.drag / model.mass, vector(model.inertia_b)
    over = 0.0625 * (NODES * h) ** 2
    f, f1, f2 = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    for k in range(NODES + 1):
        t = k * h + model.motor_time_constant
        at = m.x_r[k]
        for i in range(3):
            w2 = harmonic(v[i], a[i], j[i], s[i], over)
            way, velocity, acceleration, jerk, snap = continued(w2, v[i], a[i], j[i], s[i], t)
            at[i], at[3 + i] = p[i] + way, velocity
            f[i] = acceleration + d * velocity - push[1 + i]
            f1[i], f2[i] = jerk + d * acceleration, snap + d * jerk
        f[2] = max(DIRECTION_MIN * GRAVITY, f[2] + GRAVITY)
        rate = reference.yaw_rate + t * reference.yaw_acceleration
        yaw = reference.yaw + t * (reference.yaw_rate + t / 2 * reference.yaw_acceleration)
        axes, omega, turn = attitude_of_force(
            (f[0], f[1], f[2]),
            (f1[0], f1[1], f1[2]),
            (f2[0], f2[1], f2[2]),
            yaw,
            rate,
            reference.yaw_acceleration,
        )
        q = quaternion_of(axes)
        for i in range(4):
            at[6 + i] = q[i]
        for i in range(3):
            at[10 + i] = omega[i]
        if k < NODES:
            size = math.sqrt(f[0] ** 2 + f[1] ** 2 + f[2] ** 2)
            needed = turn[0] - spin[0], turn[1] - spin[1], turn[2] - spin[2]
            x, y, z = add(times(J, needed), cross(omega, times(J, omega)))
            wrench = model.mass * (size - push[0]), x, y, z
            thrusts = thrusts_of_wrench(wrench, model.arm, model.torque_ratio)
            for i in range(INPUTS):
                m.u_r[k, i] = thrusts[i]


@compiled(inner=True)
def rotation_vector(q: Quaternion) -> Vector:
    """Return the rotation (rad) of a unit quaternion."""
    w, x, y, z = canonical(q)
    size = math.sqrt(x * x + y * y + z * z)
    k = 2.0 * math.atan2(size, w) / size if size > 1e-12 else 2.0
    return k * x, k * y, k * z


@compiled(inner=True)
def turning(omega: Vector, u: Array, model: Item, spin: Vector) -> Vector:
    """Return the angular acceleration (rad/s^2) of rotor thrusts u (N)."""
    J = vector(model.inertia_b)
    x, y, z = cross(omega, times(J, omega))
    return (
        (model.arm * (u[1] - u[3]) - x) / J[0] + spin[0],
        (model.arm * (u[2] - u[0]) - y) / J[1] + spin[1],
        (model.torque_ratio * (u[0] - u[1] + u[2] - u[3]) - z) / J[2] + spin[2],
    )


@compiled(inner=True)
def half_and_whole(omega: Vector, turn: Vector, h: float) -> tuple[Vector, Vector]:
    """Return the rotations (rad) of half an interval and of all of it."""
    return (
        add(scale(0.5 * h, omega), scale(0.125 * h * h, turn)),
        add(scale(h, omega), scale(0.5 * h * h, turn)),
    )


@compiled(inner=True)
def advance(
    x: Array, u: Array, push: Push, spin: Vector, model: Item, h: float, out: Array
) -> None:
    """Write the next state of the model, with the thrust along z_B of the interval's middle."""
    q, omega, d = quaternion(x[6:]), vector(x[10:]), model.drag / model.mass
    turn = turning(omega, u, model, spin)
    half, whole = half_and_whole(omega, turn, h)
    z = axes_of(turned(q, half))[2]
    lift = (u[0] + u[1] + u[2] + u[3]) / model.mass + push[0]
    for i in range(3):
        a = lift * z[i] + push[1 + i] - d * x[3 + i] - (GRAVITY if i == 2 else 0.0)
        out[i] = x[i] + h * x[3 + i] + 0.5 * h * h * a
        out[3 + i] = x[3 + i] + h * a
        out[10 + i] = omega[i] + h * turn[i]
    then = normalized(turned(q, whole))
    for i in range(4):
        out[6 + i] = then[i]


@compiled(inner=True)
def difference(x: Array, y: Array, out: Array) -> None:
    """Write the error (dp, dv, dtheta, domega) that leads from y to x."""
    for i in range(6):
        out[i] = x[i] - y[i]
    turn = rotation_vector(multiply(conjugate(quaternion(y[6:])), quaternion(x[6:])))
    for i in range(3):
        out[6 + i] = turn[i]
        out[9 + i] = x[10 + i] - y[10 + i]


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
def linearize(m: Item, k: int, lift: float, spin: Vector, model: Item, h: float) -> None:
    """Write A and B of the error about the trajectory at node k.

    Without the derivative of omega x J omega.
    """
    A, B, x, u = m.A, m.B, m.x[k], m.u[k]
    d, J, arm, c = model.drag / model.mass, vector(model.inertia_b), model.arm, model.torque_ratio
    half, whole = half_and_whole(vector(x[10:]), turning(vector(x[10:]), u, model, spin), h)
    middle = axes_of(turned(quaternion(x[6:]), half))
    # dtheta+ = exp(-w) dtheta + J_r(w) dw, and in the middle with half of w
    one = 1.0, 0.0, 0.0, 0.0
    back = axes_of(turned(one, scale(-1.0, whole)))
    half_back = axes_of(turned(one, scale(-1.0, half)))
    spread, half_spread = turn_jacobian(whole), turn_jacobian(half)
    thrust = (u[0] + u[1] + u[2] + u[3]) / model.mass + lift
    by_thrust = (
        (0.0, arm / J[0], 0.0, -arm / J[0]),
        (-arm / J[1], 0.0, arm / J[1], 0.0),
        (c / J[2], -c / J[2], c / J[2], -c / J[2]),
    )
    A[:] = 0.0
    B[:] = 0.0
    for i in range(3):
        A[i, i] = A[9 + i, 9 + i] = 1.0
        A[i, 3 + i] = h - 0.5 * h * h * d
        A[3 + i, 3 + i] = 1.0 - h * d
        for j in range(3):
            by_turn = half_back[j][1] * middle[0][i] - half_back[j][0] * middle[1][i]
            by_rate = half_spread[1][j] * middle[0][i] - half_spread[0][j] * middle[1][i]
            A[3 + i, 6 + j] = h * thrust * by_turn
            A[3 + i, 9 + j] = 0.5 * h * h * thrust * by_rate
            A[6 + i, 6 + j] = back[j][i]
            A[6 + i, 9 + j] = h * spread[i][j]
        for j in range(6):
            A[i, 6 + j] = 0.5 * h * A[3 + i, 6 + j]
        for n in range(INPUTS):
            B[9 + i, n] = h * by_thrust[i][n]
            B[3 + i, n] = h * middle[2][i] / model.mass
    for i in range(3):
        for n in range(INPUTS):
            for j in range(3):
                # of w by the thrusts: h/2 (of all) and h/4 (of half) times that of omega
                B[6 + i, n] += 0.5 * A[6 + i, 9 + j] * B[9 + j, n]
                B[3 + i, n] += 0.25 * A[3 + i, 9 + j] * B[9 + j, n]
            B[i, n] = 0.5 * h * B[3 + i, n]
