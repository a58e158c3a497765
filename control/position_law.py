"""The desired force, eq. 4, and the limits that keep it pointable."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from control.parameters import Item
from quadrotor.compiled import compiled
from quadrotor.vehicle_model import GRAVITY

Array = npt.NDArray[np.float64]

LIFT_MIN = 0.3
"""Smallest upward part of the desired force, as a share of the weight."""


@compiled
def desired_force(
    state: Item, reference: Item, integral_w: Array, gains: Item, mass: float, out: Array
) -> None:
    """f_d (N, world axes, shape (3,)) of eq. 4 into out, one record each.

    Departs from print: eq. 4 writes K_v before the integral; it is K_i, a gain of its own.

    Args:
        integral_w: (3,) m s, the integral of e_p.
    """
    for i in range(3):
        e_p = reference.position_w[i] - state.position_w[i]
        e_v = reference.velocity_w[i] - state.velocity_w[i]
        feedback = gains.kp[i] * e_p + gains.ki[i] * integral_w[i] + gains.kv[i] * e_v
        out[i] = mass * (reference.acceleration_w[i] + feedback)
    out[2] += mass * GRAVITY


@compiled
def limit_force(force_w: Array, weight: float, tan_tilt_max: float) -> bool:
    """Clamp force_w in place; True when anything was cut.

    Departs from print, where f_d = 0 has no direction and f_d below the horizon flips the
    vehicle: first f_z >= 0.3 m g, then |f_xy| <= f_z tan(tilt_max), keeping its direction.

    Args:
        weight: m g, N.
    """
    limited = False
    if force_w[2] < LIFT_MIN * weight:
        force_w[2] = LIFT_MIN * weight
        limited = True
    sideways = math.sqrt(force_w[0] * force_w[0] + force_w[1] * force_w[1])
    allowed = force_w[2] * tan_tilt_max
    if sideways > allowed:
        force_w[0] *= allowed / sideways
        force_w[1] *= allowed / sideways
        limited = True
    return limited


@compiled
def force_rates(
    state: Item,
    reference: Item,
    gains: Item,
    mass: float,
    R_wb: Array,
    force: Array,
) -> None:
    """f_d' and f_d'' (world axes) along the model into rows 1, 2 of `force` (3, 3); row 0 is f_d.

    With u_1 = f_d . z_B and z_B' = R (omega x z), eq. 2 gives the acceleration and the jerk
    that eq. 4, differentiated twice, asks for: a = u_1 z_B / m - g z_W, and
    a' = (u_1' z_B + u_1 z_B') / m with u_1' = f_d' . z_B + f_d . z_B'.
    """
    wx = state.angular_velocity_b[0]
    wy = state.angular_velocity_b[1]
    thrust = force[0, 0] * R_wb[0, 2] + force[0, 1] * R_wb[1, 2] + force[0, 2] * R_wb[2, 2]
    thrust_dot = 0.0
    for i in range(3):
        acceleration = thrust * R_wb[i, 2] / mass - (GRAVITY if i == 2 else 0.0)
        e_p = reference.position_w[i] - state.position_w[i]
        e_v = reference.velocity_w[i] - state.velocity_w[i]
        e_a = reference.acceleration_w[i] - acceleration
        feedback = gains.kp[i] * e_v + gains.ki[i] * e_p + gains.kv[i] * e_a
        force[1, i] = mass * (reference.jerk_w[i] + feedback)
        z_dot = R_wb[i, 0] * wy - R_wb[i, 1] * wx
        thrust_dot += force[1, i] * R_wb[i, 2] + force[0, i] * z_dot
    for i in range(3):
        acceleration = thrust * R_wb[i, 2] / mass - (GRAVITY if i == 2 else 0.0)
        z_dot = R_wb[i, 0] * wy - R_wb[i, 1] * wx
        e_v = reference.velocity_w[i] - state.velocity_w[i]
        e_a = reference.acceleration_w[i] - acceleration
        e_j = reference.jerk_w[i] - (thrust_dot * R_wb[i, 2] + thrust * z_dot) / mass
        feedback = gains.kp[i] * e_a + gains.ki[i] * e_v + gains.kv[i] * e_j
        force[2, i] = mass * (reference.snap_w[i] + feedback)
