"""The torques, eq. 5: PID on SO(3), gyroscopic cancellation and feed-forward."""

from __future__ import annotations

from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vectors import (
    Axes,
    Vector,
    add,
    cross,
    dot,
    subtract,
    times,
    to_body,
    to_world,
    vector,
)


@compiled(inner=True)
def attitude_error(axes: Axes, desired: Axes) -> Vector:
    """Return e_R = ½ (Rᵀ R_d - R_dᵀ R)^v, rad for small errors, about body axes.

    Args:
        axes, desired: columns of R_wb and of R_d.
    """
    return (
        0.5 * (dot(axes[2], desired[1]) - dot(axes[1], desired[2])),
        0.5 * (dot(axes[0], desired[2]) - dot(axes[2], desired[0])),
        0.5 * (dot(axes[1], desired[0]) - dot(axes[0], desired[1])),
    )


@compiled(inner=True)
def attitude_torque(
    axes: Axes,
    omega_b: Vector,
    desired: Axes,
    omega_d: Vector,
    omega_dot_d: Vector,
    e_R: Vector,
    integral_b: Vector,
    gains: Item,
    J: Vector,
) -> Vector:
    """Return the torque (N m, body axes) of eq. 5; signs as printed.

    The feed-forward transforms the desired rates from axes of R_d to body axes with E = Rᵀ R_d.
    Gains are per unit inertia; K_f is the integral gain.

    Args:
        axes, desired: columns of R_wb and of R_d.
        omega_b: rad/s, body axes.
        omega_d, omega_dot_d: rad/s and rad/s^2, axes of R_d.
        e_R: rad, see `attitude_error`.
        integral_b: rad s, integral of e_R.
        gains: one CONTROL record.
        J: diagonal inertia, kg m^2.
    """
    wanted = to_body(axes, to_world(desired, omega_d))
    wanted_dot = to_body(axes, to_world(desired, omega_dot_d))
    feedback = add(times(vector(gains.kr), e_R), times(vector(gains.kf), integral_b))
    feedback = add(feedback, times(vector(gains.kw), subtract(wanted, omega_b)))
    feed_forward = subtract(wanted_dot, cross(omega_b, wanted))  # E w_d' - w x E w_d
    gyroscopic = cross(omega_b, times(J, omega_b))
    return add(times(J, add(feedback, feed_forward)), gyroscopic)
