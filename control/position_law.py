"""The desired force, eq. 4, and the limits that keep its direction feasible."""

from __future__ import annotations

import math

from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vectors import Axes, Vector, add, along, dot, scale, subtract, times, vector
from quadrotor.vehicle_model import GRAVITY

LIFT_MIN = 0.3
"""Smallest upward part of the desired force, as a share of the weight."""


@compiled(inner=True)
def desired_force(
    e_p: Vector, e_v: Vector, integral_w: Vector, acceleration_w: Vector, gains: Item, mass: float
) -> Vector:
    """Return f_d (N, world axes) of eq. 4.

    Departs from print: eq. 4 writes K_v before the integral; it is K_i, a separate gain.

    Args:
        e_p, e_v: m and m/s, reference minus state, world axes.
        integral_w: m s, the integral of e_p.
        acceleration_w: m/s^2, of the reference.
        gains: one CONTROL record.
    """
    feedback = add(times(vector(gains.kp), e_p), times(vector(gains.kv), e_v))
    feedback = add(feedback, times(vector(gains.ki), integral_w))
    x, y, z = add(acceleration_w, feedback)
    return mass * x, mass * y, mass * (z + GRAVITY)


@compiled(inner=True)
def limit_force(force_w: Vector, weight: float, tan_tilt_max: float) -> tuple[Vector, bool]:
    """Return the force within its limits, and whether anything was cut.

    Departs from print, where f_d = 0 has no direction and f_d below the horizon flips the
    vehicle: first f_z >= 0.3 m g, then |f_xy| <= f_z tan(tilt_max), keeping its direction.

    Args:
        weight: m g, N.
    """
    x, y, z = force_w
    limited = False
    if z < LIFT_MIN * weight:
        z = LIFT_MIN * weight
        limited = True
    sideways = math.sqrt(x * x + y * y)
    allowed = z * tan_tilt_max
    if sideways > allowed:
        x *= allowed / sideways
        y *= allowed / sideways
        limited = True
    return (x, y, z), limited


@compiled(inner=True)
def force_rates(
    e_p: Vector,
    e_v: Vector,
    nominal: tuple[Vector, Vector, Vector],
    gains: Item,
    mass: float,
    axes: Axes,
    omega_b: Vector,
    force_w: Vector,
) -> tuple[Vector, Vector]:
    """Return f_d' (N/s) and f_d'' (N/s^2), world axes, along the model.

    With u_1 = f_d . z_B and z_B' = R (omega x z), eq. 2 gives the acceleration and the jerk
    that eq. 4, differentiated twice, asks for: a = u_1 z_B / m - g z_W, and
    a' = (u_1' z_B + u_1 z_B') / m with u_1' = f_d' . z_B + f_d . z_B'.

    Args:
        nominal: acceleration, jerk and snap fed forward.
        axes: columns of R_wb. omega_b: rad/s, body axes. force_w: f_d, N.
    """
    kp, kv, ki = vector(gains.kp), vector(gains.kv), vector(gains.ki)
    acceleration_w, jerk_w, snap_w = nominal
    x_b, y_b, z_b = axes
    z_b_dot = subtract(scale(omega_b[1], x_b), scale(omega_b[0], y_b))
    thrust = dot(force_w, z_b)
    acceleration = scale(thrust / mass, z_b)
    e_a = subtract(acceleration_w, acceleration)
    e_a = (e_a[0], e_a[1], e_a[2] + GRAVITY)
    rate = add(add(times(kp, e_v), times(ki, e_p)), times(kv, e_a))
    force_dot = scale(mass, add(jerk_w, rate))
    thrust_dot = dot(force_dot, z_b) + dot(force_w, z_b_dot)
    jerk = scale(1.0 / mass, along(scale(thrust_dot, z_b), thrust, z_b_dot))
    e_j = subtract(jerk_w, jerk)
    rate = add(add(times(kp, e_a), times(ki, e_v)), times(kv, e_j))
    force_ddot = scale(mass, add(snap_w, rate))
    return force_dot, force_ddot
