"""Incremental nonlinear dynamic inversion of the angular acceleration, below the paper's eq. 4.

E. J. J. Smeur, Q. Chu, G. C. H. E. de Croon, "Adaptive incremental nonlinear dynamic inversion for
attitude control of micro air vehicles", JGCD 39(3), 2016; E. Tal, S. Karaman, "Accurate tracking of
aggressive quadrotor trajectories using incremental nonlinear dynamic inversion and differential
flatness", CDC 2018 and IEEE T-CST 2021:

    virtual control   nu = K_R e_R + K_w (omega_d - omega) + omega_d'
    increment         tau = tau_f + J (nu - omega_f')

with omega_f' and tau_f behind the same second-order filter H(s), so that both are late by the same
time. The torque of the actuators is that of the rotors' model: no board here reports their speeds
in flight. On the ground, where the feet carry a torque, the inversion is not incremental.
"""

from __future__ import annotations

import numpy as np

from control.attitude_law import attitude_error, attitude_torque
from control.disturbance_observer import DISTURBANCE
from control.geometric_law import fed_forward, wind
from control.laws import CompiledLaw, Own, Records, settings_type
from control.position_law import desired_force, limit_force
from extensions.laws.desired import (
    FOLLOWING,
    desired_axes,
    finish,
    flat_rates,
    flown_acceleration,
    follow,
    low_pass,
)
from extensions.laws.parameters import IndiParameters
from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.rigid_body import motor_share, rotors
from quadrotor.vectors import Vector, add, axes_of, cross, dot, quaternion, subtract, times, vector
from quadrotor.vehicle_model import GRAVITY, Four

SETTINGS = settings_type(IndiParameters)
INNER = np.dtype(
    [
        ("running", "i8"),
        ("rotor_speeds", "f8", 4),  # counts, of the model
        ("omega", "f8", (2, 3)),  # rad/s and rad/s^2, filtered
        ("torque", "f8", (2, 3)),  # N m and N m/s, of the rotors' model, filtered
        ("desired_attitude", "f8", (3, 3)),
        ("disturbance", DISTURBANCE),  # stays empty
    ],
    align=True,
)
MEMORY = np.dtype([("inner", INNER), ("position_integral_w", "f8", 3)], align=True)


@compiled(inner=True)
def follow_rotors(m: Item, model: Item, actuators: Item, dt: float) -> Four:
    """Return the wrench of the rotors' model, after dt (s) of the last commands."""
    n = m.rotor_speeds
    share = motor_share(model.motor_time_constant, dt)
    for i in range(4):
        n[i] += share * (actuators.motor_references[i] - n[i])
    speeds = n[0], n[1], n[2], n[3]
    return rotors(speeds, model.motor_slope, model.motor_offset, model.arm, model.torque_ratio)


@compiled(inner=True)
def sense(
    m: Item,
    filters: tuple[float, float, float],
    state: Item,
    model: Item,
    actuators: Item,
    dt: float,
) -> Four:
    """Advance the filters of angular velocity and torque; return the rotors' wrench.

    Args:
        filters: cutoff about x and y, and about z, rad/s; damping ratio.
    """
    if m.running == 0:
        for i in range(4):
            m.rotor_speeds[i] = actuators.motor_references[i]
    wrench = follow_rotors(m, model, actuators, dt)
    if m.running == 0:
        m.running = 1
        for i in range(3):
            m.omega[0, i], m.torque[0, i] = state.angular_velocity_b[i], wrench[1 + i]
    for i in range(3):
        cutoff = filters[1] if i == 2 else filters[0]
        low_pass(m.omega, i, state.angular_velocity_b[i], cutoff, filters[2], dt)
        low_pass(m.torque, i, wrench[1 + i], cutoff, filters[2], dt)
    return wrench


@compiled(inner=True)
def incremental_torque(m: Item, nu: Vector, omega_b: Vector, airborne: bool, J: Vector) -> Vector:
    """Return tau (N m, body axes) for the angular acceleration nu (rad/s^2)."""
    if not airborne:
        return add(times(J, nu), cross(omega_b, times(J, omega_b)))
    turn = m.omega[1, 0], m.omega[1, 1], m.omega[1, 2]
    torque = m.torque[0, 0], m.torque[0, 1], m.torque[0, 2]
    return add(torque, times(J, subtract(nu, turn)))


@compiled(inner=True)
def virtual_control(
    m: Item,
    state: Item,
    force_w: Vector,
    rates: tuple[Vector, Vector],
    yaw: float,
    gains: Item,
    weight: float,
) -> Vector:
    """Return nu (rad/s^2) by the attitude gains of the paper's law, without integral."""
    axes, omega_b = axes_of(quaternion(state.quaternion_wb)), vector(state.angular_velocity_b)
    desired = desired_axes(m.desired_attitude, force_w, yaw, weight)
    e_R = attitude_error(axes, desired)
    none, unit = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    return attitude_torque(
        axes, omega_b, desired, rates[0], rates[1], e_R, integral_b=none, gains=gains, J=unit
    )


@compiled(inner=True)
def fly_one(
    memory: Item,
    s: Item,
    state: Item,
    reference: Item,
    gains: Item,
    model: Item,
    flown: bool,
    airborne: bool,
    dt: float,
    actuators: Item,
) -> None:
    """Compute one tick; see `control.laws`."""
    m, mass, weight = memory.inner, model.mass, model.mass * GRAVITY
    sense(m, (s.cutoff, s.yaw_cutoff, s.damping), state, model, actuators, dt)
    axes = axes_of(quaternion(state.quaternion_wb))
    acceleration_w, jerk_w, snap_w, _ = fed_forward(m.disturbance, reference, model, axes)
    e_p = subtract(vector(reference.position_w), vector(state.position_w))
    e_v = subtract(vector(reference.velocity_w), vector(state.velocity_w))
    integral_w = vector(memory.position_integral_w)
    wanted = desired_force(e_p, e_v, integral_w, acceleration_w, gains, mass)
    force, limited = limit_force(wanted, weight, gains.tan_tilt_max)
    rates = flat_rates(acceleration_w, jerk_w, snap_w, reference)
    nu = virtual_control(m, state, force, rates, reference.yaw, gains, weight=weight)
    omega_b, J = vector(state.angular_velocity_b), vector(model.inertia_b)
    torque = incremental_torque(m, nu, omega_b, airborne, J)
    pushed = flown_acceleration(actuators, axes, mass)
    scaling = finish(dot(force, axes[2]), torque, gains.yaw_torque_max, model, actuators)
    if airborne and not flown:
        none = (0.0, 0.0, 0.0)
        x, y, z = desired_force(e_p, e_v, none, acceleration_w, gains, 1.0)
        share = min(1.0, dt / FOLLOWING)
        follow(memory.position_integral_w, pushed, (x, y, z - GRAVITY), vector(gains.ki), share)
    if flown and airborne and scaling == 1.0 and not limited:
        wind(memory.position_integral_w, e_p, dt, gains.position_integral_max)


@compiled(pointer=True)
def step(own: Own, records: Records, flown: bool, airborne: bool, dt: float) -> None:
    """Compute one tick; see `control.laws`."""
    memory, settings = own
    state, reference, gains, model, actuators = records
    m, s = memory.view(MEMORY)[0], settings.view(SETTINGS)[0]
    fly_one(
        m,
        s,
        state[0],
        reference[0],
        gains[0],
        model[0],
        flown=flown,
        airborne=airborne,
        dt=dt,
        actuators=actuators[0],
    )


LAW = CompiledLaw(step, MEMORY)
