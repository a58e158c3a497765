"""The parts that laws share: desired attitude with its rates, filters, and the last steps."""

from __future__ import annotations

import math

from control.allocation import allocate
from control.desired_attitude import attitude_of_force, axes_of_force
from control.geometric_law import DIRECTION_MIN, command
from quadrotor.compiled import compiled
from quadrotor.records import Array, Item
from quadrotor.vectors import Axes, Vector, dot, scale
from quadrotor.vehicle_model import GRAVITY


@compiled(inner=True)
def desired_axes(kept: Array, force_w: Vector, yaw: float, weight: float) -> Axes:
    """Return R_d along a force (N), or the last one where the force has no usable direction.

    Args:
        kept: (3, 3), its columns; zeros before the first.
    """
    square = dot(force_w, force_w)
    if square >= (DIRECTION_MIN * weight) ** 2 and math.isfinite(square + yaw):
        axes = axes_of_force(force_w, yaw)
        for j in range(3):
            for i in range(3):
                kept[i, j] = axes[j][i]
    elif kept[0, 0] == 0.0 and kept[1, 0] == 0.0 and kept[2, 0] == 0.0:
        for i in range(3):
            kept[i, i] = 1.0
    return (
        (kept[0, 0], kept[1, 0], kept[2, 0]),
        (kept[0, 1], kept[1, 1], kept[2, 1]),
        (kept[0, 2], kept[1, 2], kept[2, 2]),
    )


@compiled(inner=True)
def flat_rates(
    acceleration_w: Vector, jerk_w: Vector, snap_w: Vector, reference: Item
) -> tuple[Vector, Vector]:
    """Return omega_d (rad/s) and omega_d' (rad/s^2), axes of R_d, of the flat outputs.

    Args:
        acceleration_w: m/s^2, which the thrust gives in addition to the weight, with its
            derivatives.
    """
    f = acceleration_w[0], acceleration_w[1], acceleration_w[2] + GRAVITY
    omega = turn = (0.0, 0.0, 0.0)
    if f[2] >= DIRECTION_MIN * GRAVITY:
        _, omega, turn = attitude_of_force(
            f, jerk_w, snap_w, reference.yaw, reference.yaw_rate, reference.yaw_acceleration
        )
    return omega, turn


FOLLOWING = 0.5
"""s, time constant of the integrals of a shadow, which follow what is flown."""


@compiled(inner=True)
def follow(integral: Array, flown: Vector, without: Vector, gain: Vector, share: float) -> None:
    """Move an integral towards the value with which the law would command the present motion.

    So nothing jumps when the law takes over.

    Args:
        flown, without: what is commanded, and what the law commands without the integral.
        gain: of the integral. share: of the way.
    """
    for i in range(3):
        if gain[i] > 0.0:
            integral[i] += share * ((flown[i] - without[i]) / gain[i] - integral[i])


@compiled(inner=True)
def flown_acceleration(actuators: Item, axes: Axes, mass: float) -> Vector:
    """Return the acceleration (m/s^2) that the commanded thrust gives, less the weight."""
    x, y, z = specific_force(actuators.wrench[0], mass, axes)
    return x, y, z - GRAVITY


@compiled(inner=True)
def low_pass(memory: Array, i: int, value: float, cutoff: float, damping: float, dt: float) -> None:
    """Advance H(s) = w^2 / (s^2 + 2 d w s + w^2) in memory[:, i]: value and derivative.

    The semi-implicit step is stable up to w dt = 1.
    """
    rate = memory[1, i]
    rate += dt * (cutoff * cutoff * (value - memory[0, i]) - 2.0 * damping * cutoff * rate)
    memory[1, i] = rate
    memory[0, i] += dt * rate


@compiled(inner=True)
def finish(
    thrust: float, torque_b: Vector, yaw_torque_max: float, model: Item, actuators: Item
) -> float:
    """Write the actuators of a wrench by the rules of the paper's law; return the scaling."""
    x, y, z = torque_b
    z = min(yaw_torque_max, max(-yaw_torque_max, z))
    thrust = 0.0 if thrust < 0.0 else thrust
    thrusts, scaling = allocate((thrust, x, y, z), model)
    command(thrusts, scaling, model, actuators)
    return scaling


@compiled(inner=True)
def specific_force(thrust: float, mass: float, axes: Axes) -> Vector:
    """Return the thrust over the mass (m/s^2) in world axes."""
    return scale(thrust / mass, axes[2])
