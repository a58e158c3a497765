"""The desired attitude and its rates from a force and a yaw, Sec. 4.

R_d has z_d along the force, x_d along y_C x z_d with y_C = (-sin yaw, cos yaw, 0), and
y_d = z_d x x_d. For a force above the horizon the ZYX yaw of R_d is the given yaw exactly.
Singular only where the force is parallel to y_C, which the force limits exclude.

A triple (a, a', a'') below is a vector with its first and second time derivative.
"""

from __future__ import annotations

import math

from quadrotor.compiled import compiled
from quadrotor.vectors import Axes, Vector, add, along, cross, dot, scale

Motion = tuple[Vector, Vector, Vector]


@compiled(inner=True)
def _unit(a: Vector) -> Vector:
    return scale(1.0 / math.sqrt(dot(a, a)), a)


@compiled(inner=True)
def _unit_motion(a: Motion) -> Motion:
    """Return u = a / |a|.

    |a|' = u . a', u' = (a' - u |a|') / |a|, |a|'' = u' . a' + u . a'',
    u'' = (a'' - 2 u' |a|' - u |a|'') / |a|.
    """
    k = 1.0 / math.sqrt(dot(a[0], a[0]))
    u = scale(k, a[0])
    n_dot = dot(u, a[1])
    u_dot = scale(k, along(a[1], -n_dot, u))
    n_ddot = dot(u_dot, a[1]) + dot(u, a[2])
    u_ddot = scale(k, along(along(a[2], -2.0 * n_dot, u_dot), -n_ddot, u))
    return u, u_dot, u_ddot


@compiled(inner=True)
def _cross_motion(a: Motion, b: Motion) -> Motion:
    """Return a x b."""
    first = add(cross(a[1], b[0]), cross(a[0], b[1]))
    second = add(cross(a[2], b[0]), cross(a[0], b[2]))
    return cross(a[0], b[0]), first, along(second, 2.0, cross(a[1], b[1]))


@compiled(inner=True)
def axes_of_force(force_w: Vector, yaw: float) -> Axes:
    """Return the columns of R_d (world axes) for a force and a yaw.

    The force (N) is neither zero nor parallel to y_C.
    """
    z = _unit(force_w)
    x = _unit(cross((-math.sin(yaw), math.cos(yaw), 0.0), z))
    return x, cross(z, x), z


@compiled(inner=True)
def attitude_of_force(
    force_w: Vector,
    force_dot_w: Vector,
    force_ddot_w: Vector,
    yaw: float,
    yaw_rate: float,
    yaw_acceleration: float,
) -> tuple[Axes, Vector, Vector]:
    """Return the columns of R_d, omega_d (rad/s) and omega_d' (rad/s^2), the rates in axes of R_d.

    omega_d = (R_d^T R_d')^v and omega_d' = (R_d^T R_d'')^v: R'' = R (hat(w') + hat(w)^2), and
    hat(w)^2 is symmetric, so the skew part of R^T R'' is w'.

    Args:
        force_w: N, world axes, not zero, not parallel to y_C; its derivatives are in N/s and N/s^2.
        yaw: rad; its derivatives are in rad/s and rad/s^2.
    """
    s, c = math.sin(yaw), math.cos(yaw)
    square = yaw_rate * yaw_rate
    y_c = (
        (-s, c, 0.0),
        (-c * yaw_rate, -s * yaw_rate, 0.0),
        (-c * yaw_acceleration + s * square, -s * yaw_acceleration - c * square, 0.0),
    )
    z = _unit_motion((force_w, force_dot_w, force_ddot_w))
    x = _unit_motion(_cross_motion(y_c, z))
    y = _cross_motion(z, x)
    omega = (dot(z[0], y[1]), dot(x[0], z[1]), dot(y[0], x[1]))
    omega_dot = (
        0.5 * (dot(z[0], y[2]) - dot(y[0], z[2])),
        0.5 * (dot(x[0], z[2]) - dot(z[0], x[2])),
        0.5 * (dot(y[0], x[2]) - dot(x[0], y[2])),
    )
    return (x[0], y[0], z[0]), omega, omega_dot
