"""Rigid-body dynamics with first-order motors: eqs. 2 and 3 and Sec. 5.3.

The state is a STATE record and four rotor speeds, in motor-reference counts (speed is linear in
them). It is integrated by the classical fourth-order Runge-Kutta scheme; the quaternion is
renormalised once per step. The work is done on tuples (quadrotor/vectors.py), for loops that stay
in registers.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.vectors import Quaternion, Vector, along, normalized
from quadrotor.vehicle_model import GRAVITY, Four, thrust_of_reference, wrench_of_thrusts

Array = npt.NDArray[np.float64]
Motion = tuple[Vector, Vector, Quaternion, Vector]
"""position_w (m), velocity_w (m/s), quaternion_wb, angular_velocity_b (rad/s)."""

STOPPED = 1.0
"""Counts at or below which a rotor produces no thrust."""


@compiled(inner=True)
def _lean(q: Quaternion) -> Vector:
    """Return (a, b, c) with z_B = (2 a, 2 b, 1 - 2 c)."""
    w, x, y, z = q
    return x * z + w * y, y * z - w * x, x * x + y * y


@compiled(inner=True)
def _turning(q: Quaternion, omega: Vector) -> Quaternion:
    """Return 2 q' = q (x) (0, omega)."""
    w, a, b, c = q
    x, y, z = omega
    return (
        -a * x - b * y - c * z,
        w * x + b * z - c * y,
        w * y + c * x - a * z,
        w * z + a * y - b * x,
    )


@compiled(inner=True)
def _spin(omega: Vector, turn: Vector, ratios: Vector) -> Vector:
    """Return omega' of eq. 3; `turn` is the torque over the inertia."""
    x, y, z = omega
    return turn[0] - ratios[0] * y * z, turn[1] - ratios[1] * z * x, turn[2] - ratios[2] * x * y


@compiled(inner=True)
def gyroscopic_ratios(J: Vector, inverse: Vector) -> Vector:
    """Return ((J_z - J_y) / J_x, ...), the factors of omega x J omega; `inverse` is 1 / J."""
    return (J[2] - J[1]) * inverse[0], (J[0] - J[2]) * inverse[1], (J[1] - J[0]) * inverse[2]


@compiled(inner=True)
def _ahead(q: Quaternion, s: float, d: Quaternion) -> Quaternion:
    """Return q + s d."""
    return q[0] + s * d[0], q[1] + s * d[1], q[2] + s * d[2], q[3] + s * d[3]


@compiled(inner=True)
def rk4(
    motion: Motion,
    lifts: Vector,
    push_w: Vector,
    damping: float,
    turns: tuple[Vector, Vector, Vector],
    ratios: Vector,
    dt: float,
) -> Motion:
    """Return the motion after dt (s) under thrust and torque that change within the step.

    This is the classical scheme, ordered by dependence: omega depends on nothing else, the attitude
    on omega, the velocity on the attitude, the position on the velocity. Each stage equals that of
    the scheme applied to all 13 numbers at once.

    Args:
        lifts: thrust over mass, m/s^2, at the beginning, the middle and the end of the step.
        push_w: further force over mass, m/s^2, without gravity and the damping; held constant.
        damping: linear drag over mass, 1/s, against the velocity over ground.
        turns: torque over inertia, rad/s^2, at the same three instants.
        ratios: see `gyroscopic_ratios`.
    """
    p, v1, q, w1 = motion
    start, middle, end = turns
    half, sixth = 0.5 * dt, dt / 6.0
    s1 = _spin(w1, start, ratios)
    w2 = along(w1, half, s1)
    s2 = _spin(w2, middle, ratios)
    w3 = along(w1, half, s2)
    s3 = _spin(w3, middle, ratios)
    w4 = along(w1, dt, s3)
    s4 = _spin(w4, end, ratios)
    w = along(w1, sixth, along(along(s1, 1.0, s4), 2.0, along(s2, 1.0, s3)))

    t1 = _turning(q, w1)
    q2 = _ahead(q, 0.5 * half, t1)
    t2 = _turning(q2, w2)
    q3 = _ahead(q, 0.5 * half, t2)
    t3 = _turning(q3, w3)
    q4 = _ahead(q, half, t3)
    t4 = _turning(q4, w4)
    q_end = _ahead(q, 0.5 * sixth, _ahead(_ahead(t1, 1.0, t4), 2.0, _ahead(t2, 1.0, t3)))

    a1 = _acceleration(q, lifts[0], push_w, damping, v1)
    v2 = along(v1, half, a1)
    a2 = _acceleration(q2, lifts[1], push_w, damping, v2)
    v3 = along(v1, half, a2)
    a3 = _acceleration(q3, lifts[1], push_w, damping, v3)
    v4 = along(v1, dt, a3)
    a4 = _acceleration(q4, lifts[2], push_w, damping, v4)
    v = along(v1, sixth, along(along(a1, 1.0, a4), 2.0, along(a2, 1.0, a3)))
    path = along(along(v1, 1.0, v4), 2.0, along(v2, 1.0, v3))
    return along(p, sixth, path), v, normalized(q_end), w


@compiled(inner=True)
def _acceleration(q: Quaternion, lift: float, push_w: Vector, damping: float, v: Vector) -> Vector:
    """Return v' of eq. 2 with linear drag, world axes."""
    a, b, c = _lean(q)
    return (
        2.0 * a * lift + push_w[0] - damping * v[0],
        2.0 * b * lift + push_w[1] - damping * v[1],
        (1.0 - 2.0 * c) * lift + push_w[2] - damping * v[2] - GRAVITY,
    )


@compiled(inner=True)
def motion_of(x: Array) -> Motion:
    """Return the tuples of x (13,)."""
    return ((x[0], x[1], x[2]), (x[3], x[4], x[5]), (x[6], x[7], x[8], x[9]), (x[10], x[11], x[12]))


@compiled(inner=True)
def store_motion(motion: Motion, x: Array) -> None:
    """Store the tuples in x (13,)."""
    p, v, q, w = motion
    x[0], x[1], x[2] = p
    x[3], x[4], x[5] = v
    x[6], x[7], x[8], x[9] = q
    x[10], x[11], x[12] = w


@compiled(inner=True)
def drag_torque(lever: float, force_b: Vector) -> Vector:
    """Return the torque (N m) of a drag force (N) acting `lever` (m) above the centre of mass."""
    return -lever * force_b[1], lever * force_b[0], 0.0


@compiled(inner=True)
def motor_share(time_constant: float, dt: float) -> float:
    """Return the share of the way to a held reference that a rotor covers in any dt (s): exact."""
    return 1.0 - math.exp(-dt / time_constant)


@compiled(inner=True)
def rotor_thrust(speed: float, slope: float, offset: float) -> float:
    """Return the thrust (N) of one rotor at `speed` (counts); a stopped one produces none."""
    return thrust_of_reference(speed, slope, offset) if speed > STOPPED else 0.0


@compiled(inner=True)
def rotors(speeds: Four, slope: float, offset: float, arm: float, ratio: float) -> Four:
    """Return the wrench of four rotors at `speeds` (counts): thrust (N), torques (N m), eq. 1."""
    front = rotor_thrust(speeds[0], slope, offset)
    left = rotor_thrust(speeds[1], slope, offset)
    rear = rotor_thrust(speeds[2], slope, offset)
    right = rotor_thrust(speeds[3], slope, offset)
    return wrench_of_thrusts((front, left, rear, right), arm, ratio)
