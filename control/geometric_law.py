"""The geometric law: eqs. 4 and 5, saturation and wind-up rules, for N vehicles at once."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from control.allocation import allocate
from control.attitude_law import attitude_error, attitude_torque
from control.desired_attitude import attitude_of_force, axes_of_force
from control.disturbance_observer import DISTURBANCE
from control.position_law import desired_force, force_rates, limit_force
from quadrotor.compiled import compiled
from quadrotor.records import Item, Record
from quadrotor.rigid_body import drag_torque
from quadrotor.vectors import (
    Axes,
    Vector,
    add,
    along,
    axes_of,
    dot,
    quaternion,
    scale,
    subtract,
    to_body,
    vector,
)
from quadrotor.vehicle_model import GRAVITY, Four, reference_of_thrust, wrench_of_thrusts

Array = npt.NDArray[np.float64]

DIRECTION_MIN = 0.1
"""Share of the weight below which a force has no usable direction."""

CONTROL_MEMORY = np.dtype(
    [
        ("position_integral_w", "f8", 3),  # m s
        ("attitude_integral_b", "f8", 3),  # rad s
        ("desired_attitude", "f8", (3, 3)),  # R_d of the last tick that had one
        ("tilt_limited", "i8"),  # 1 while the force limits act
        ("disturbance", DISTURBANCE),  # subtracted from force and torque
    ],
    align=True,
)


def new_control_memory(size: int = 1) -> Record:
    """Return reset integrals and a level desired attitude, shape (size,)."""
    memory = np.zeros(size, CONTROL_MEMORY)
    memory["desired_attitude"] = np.eye(3)
    return memory


@compiled(inner=True)
def wind(integral: Array, error: Vector, dt: float, bound: float) -> None:
    """Add error dt to an integral (3,), each axis within +-bound; NaN adds nothing."""
    for i in range(3):
        if math.isfinite(error[i]):
            integral[i] = min(bound, max(-bound, integral[i] + error[i] * dt))


@compiled(inner=True)
def _remembered(memory: Item) -> Axes:
    m = memory.desired_attitude
    return ((m[0, 0], m[1, 0], m[2, 0]), (m[0, 1], m[1, 1], m[2, 1]), (m[0, 2], m[1, 2], m[2, 2]))


@compiled(inner=True)
def _remember(memory: Item, axes: Axes) -> None:
    m = memory.desired_attitude
    for j in range(3):
        for i in range(3):
            m[i, j] = axes[j][i]


@compiled(inner=True)
def fed_forward(
    disturbance: Item, reference: Item, model: Item, axes: Axes
) -> tuple[Vector, Vector, Vector, Vector]:
    """Return the feed-forward accelerations, and the torque (N m) to subtract.

    The acceleration (m/s^2), with its two derivatives, is what force over mass has to give in
    addition to the feedback: that of the reference plus the drag at its velocity, less the
    estimated disturbing force but for its share `lift` along z_B, which is subtracted from the
    thrust. The torque is the disturbing torque and that of the drag.
    """
    by_mass = 1.0 / model.mass
    drag = model.drag * by_mass
    acceleration_w, jerk_w = vector(reference.acceleration_w), vector(reference.jerk_w)
    pushed = along(acceleration_w, drag, vector(reference.velocity_w))
    pushed_dot = along(jerk_w, drag, acceleration_w)
    drag_b = scale(-model.drag, to_body(axes, vector(reference.velocity_w)))
    across_w = along(vector(disturbance.force_w), -disturbance.lift, axes[2])
    pushed_ddot = along(vector(reference.snap_w), drag, jerk_w)
    return (
        along(pushed, -by_mass, across_w),
        along(pushed_dot, -by_mass, vector(disturbance.force_rate_w)),
        along(pushed_ddot, -by_mass, vector(disturbance.force_curve_w)),
        add(vector(disturbance.torque_b), drag_torque(model.drag_lever, drag_b)),
    )


@compiled(inner=True)
def hand_over(memory: Item, gains: Item, model: Item) -> None:
    """Move what the observer begins or ends subtracting from or to the integrals."""
    d, mass, J = memory.disturbance, model.mass, model.inertia_b
    if d.force_begun > 0.0 or d.torque_begun > 0.0:
        for i in range(3):
            memory.position_integral_w[i] *= 1.0 - d.force_begun
            memory.attitude_integral_b[i] *= 1.0 - d.torque_begun
        d.force_begun = d.torque_begun = 0.0
    for i in range(3):
        integral, bound = memory.position_integral_w, gains.position_integral_max
        _give_back(integral, i, d.force_ended_w[i], mass * gains.ki[i], bound)
        integral, bound = memory.attitude_integral_b, gains.attitude_integral_max
        _give_back(integral, i, d.torque_ended_b[i], J[i] * gains.kf[i], bound)
        d.force_ended_w[i] = d.torque_ended_b[i] = 0.0


@compiled(inner=True)
def _give_back(integral: Array, i: int, ended: float, stiffness: float, bound: float) -> None:
    if ended != 0.0 and stiffness > 0.0:
        integral[i] = min(bound, max(-bound, integral[i] - ended / stiffness))


@compiled(inner=True)
def step_one(
    memory: Item,
    state: Item,
    reference: Item,
    gains: Item,
    model: Item,
    airborne: bool,
    dt: float,
    actuators: Item,
) -> None:
    """Compute one vehicle, with records in place of arrays; see `step`."""
    mass = model.mass
    weight = mass * GRAVITY
    axes = axes_of(quaternion(state.quaternion_wb))
    omega_b = vector(state.angular_velocity_b)
    acceleration_w, jerk_w, snap_w, off = fed_forward(memory.disturbance, reference, model, axes)
    e_p = subtract(vector(reference.position_w), vector(state.position_w))
    e_v = subtract(vector(reference.velocity_w), vector(state.velocity_w))

    hand_over(memory, gains, model)
    integral_w = vector(memory.position_integral_w)
    wanted = desired_force(e_p, e_v, integral_w, acceleration_w, gains, mass)
    force, limited = limit_force(wanted, weight, gains.tan_tilt_max)
    memory.tilt_limited = 1 if limited else 0

    omega_d = omega_dot_d = (0.0, 0.0, 0.0)
    # Print leaves f_d = 0 open. A force too small (or not finite) keeps the last R_d, at rest.
    square = dot(force, force)
    yaw = reference.yaw
    if square >= (DIRECTION_MIN * weight) ** 2 and math.isfinite(square + yaw):
        desired = axes_of_force(force, yaw)
        _remember(memory, desired)
        # omega_d from the nominal force m (r_t'' + g z), which is what the paper's text says
        # ("derivatives up to the fourth order"); from the exact one as an option.
        if gains.exact_rates == 1:
            f = force
            nominal = acceleration_w, jerk_w, snap_w
            f_dot, f_ddot = force_rates(
                e_p, e_v, nominal, gains, mass, axes, omega_b=omega_b, force_w=force
            )
        else:
            f = (acceleration_w[0], acceleration_w[1], acceleration_w[2] + GRAVITY)
            f = scale(mass, f)
            f_dot, f_ddot = scale(mass, jerk_w), scale(mass, snap_w)
        if f[2] >= DIRECTION_MIN * weight:
            _, omega_d, omega_dot_d = attitude_of_force(
                f, f_dot, f_ddot, yaw, reference.yaw_rate, reference.yaw_acceleration
            )
    else:
        desired = _remembered(memory)

    # u_1 = f_d . z_B. Departs from print: it is not below zero. Upside down it would be negative,
    # which no rotor can give, and the common scaling would remove the torques that turn the vehicle
    # upright.
    thrust = dot(force, axes[2]) - memory.disturbance.lift
    thrust = 0.0 if thrust < 0.0 else thrust  # keeps a NaN, which max() would hide
    e_R = attitude_error(axes, desired)
    integral_b = vector(memory.attitude_integral_b)
    J = vector(model.inertia_b)
    x, y, z = attitude_torque(
        axes, omega_b, desired, omega_d, omega_dot_d, e_R, integral_b=integral_b, gains=gains, J=J
    )
    x, y, z = x - off[0], y - off[1], z - off[2]
    # Departs from print: yaw has a thirtieth of the others' authority, and by the common scaling an
    # unbounded yaw torque would reduce theirs.
    bound = gains.yaw_torque_max
    z = min(bound, max(-bound, z))
    thrusts, scaling = allocate((thrust, x, y, z), model)

    # Wind-up, unspecified in print: clamped, and frozen on the ground and while anything saturates.
    if airborne and scaling == 1.0 and not limited:
        wind(memory.position_integral_w, e_p, dt, gains.position_integral_max)
        wind(memory.attitude_integral_b, e_R, dt, gains.attitude_integral_max)
    command(thrusts, scaling, model, actuators)


@compiled(inner=True)
def command(thrusts: Four, scaling: float, model: Item, actuators: Item) -> None:
    """Write thrusts (N), their wrench and their motor references into one ACTUATORS record."""
    wrench = wrench_of_thrusts(thrusts, model.arm, model.torque_ratio)
    for i in range(4):
        actuators.thrusts[i] = thrusts[i]
        actuators.wrench[i] = wrench[i]
        actuators.motor_references[i] = reference_of_thrust(
            thrusts[i], model.motor_slope, model.motor_offset
        )
    actuators.scaling = scaling


@compiled
def step(
    memory: Record,
    state: Record,
    reference: Record,
    gains: Record,
    model: Record,
    airborne: bool,
    dt: float,
    actuators: Record,
) -> None:
    """Compute the actuators from state and reference, in place; all arrays of records, shape (N,).

    `gains` and `model` may have shape (1,) for all. `actuators.wrench` is M f of the commanded
    thrusts, so after the scaling. Integrals are updated last, depending on this tick's saturation.

    Args:
        memory: CONTROL_MEMORY, see `new_control_memory`.
        airborne: False freezes the integrals.
        dt: s since the last step.
    """
    for k in range(state.shape[0]):
        step_one(
            memory[k],
            state[k],
            reference[k],
            gains[min(k, gains.shape[0] - 1)],
            model[min(k, model.shape[0] - 1)],
            airborne,
            dt=dt,
            actuators=actuators[k],
        )


@compiled
def apply_wrench(wrench: Array, model: Record, actuators: Record) -> None:
    """Write the actuators for a wrench (1, 4) (N, N m) of another law, in place.

    Args:
        model: MODEL (1,).
        actuators: ACTUATORS (1,).
    """
    u = wrench[0]
    thrusts, scaling = allocate((u[0], u[1], u[2], u[3]), model[0])
    command(thrusts, scaling, model[0], actuators[0])
