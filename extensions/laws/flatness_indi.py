"""Differential flatness with drag, and incremental inversion of force and torque.

S. Sun, A. Romero, P. Foehn, E. Kaufmann, D. Scaramuzza, "A comparative study of nonlinear MPC and
differential-flatness-based control for quadrotor agile flight", IEEE T-RO 38(6), 2022: rates and
their derivatives from the flat outputs with rotor drag, INDI below. E. Tal, S. Karaman, "Accurate
tracking of aggressive quadrotor trajectories using incremental nonlinear dynamic inversion and
differential flatness", IEEE T-CST 29(3), 2021: the increment of the force,

    acceleration   a_c = a_r + K_p e_p + K_v e_v
    increment      f_c = (u_1 z_B)_f + m (a_c - a_f)

with a_f and (u_1 z_B)_f behind the same second-order filter. Departs from print: a_f is the
derivative of the estimated velocity, which has the accelerometer in it; the attitude error is that
of the paper's law with its bounded yaw torque, which like the tilt-prioritised one of Sun et al.
gives yaw no authority of roll and pitch.
"""

from __future__ import annotations

import numpy as np

from control.geometric_law import fed_forward
from control.laws import CompiledLaw, Own, Records, settings_type
from control.position_law import desired_force, limit_force
from extensions.laws.desired import finish, flat_rates, low_pass, specific_force
from extensions.laws.indi import INNER, incremental_torque, sense, virtual_control
from extensions.laws.parameters import FlatnessIndiParameters
from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vectors import axes_of, dot, quaternion, subtract, vector
from quadrotor.vehicle_model import GRAVITY

SETTINGS = settings_type(FlatnessIndiParameters)
MEMORY = np.dtype(
    [
        ("inner", INNER),
        ("running", "i8"),
        ("velocity", "f8", (2, 3)),  # m/s and m/s^2, world axes, filtered
        ("force", "f8", (2, 3)),  # m/s^2 and m/s^3: thrust over mass, world axes, filtered
    ],
    align=True,
)


@compiled(inner=True)
def fly_one(
    memory: Item,
    s: Item,
    state: Item,
    reference: Item,
    gains: Item,
    model: Item,
    airborne: bool,
    dt: float,
    actuators: Item,
) -> None:
    """Compute one tick; see `control.laws`."""
    m, mass, weight = memory.inner, model.mass, model.mass * GRAVITY
    wrench = sense(m, (s.cutoff, s.yaw_cutoff, s.damping), state, model, actuators, dt)
    axes = axes_of(quaternion(state.quaternion_wb))
    pushed_w = specific_force(wrench[0], mass, axes)
    if memory.running == 0 or not airborne:
        memory.running = 1
        for i in range(3):
            memory.velocity[0, i], memory.force[0, i] = state.velocity_w[i], pushed_w[i]
            memory.velocity[1, i] = memory.force[1, i] = 0.0
    for i in range(3):
        low_pass(memory.velocity, i, state.velocity_w[i], s.force_cutoff, s.damping, dt)
        low_pass(memory.force, i, pushed_w[i], s.force_cutoff, s.damping, dt)
    acceleration_w, jerk_w, snap_w, _ = fed_forward(m.disturbance, reference, model, axes)
    e_p = subtract(vector(reference.position_w), vector(state.position_w))
    e_v = subtract(vector(reference.velocity_w), vector(state.velocity_w))
    none = (0.0, 0.0, 0.0)
    if airborne:
        # desired_force adds the weight, which the measured force has in it.
        f, a, r = memory.force, memory.velocity, reference.acceleration_w
        rest = (
            r[0] + f[0, 0] - a[1, 0],
            r[1] + f[0, 1] - a[1, 1],
            r[2] + f[0, 2] - a[1, 2] - GRAVITY,
        )
        wanted = desired_force(e_p, e_v, none, rest, gains, mass)
    else:
        wanted = desired_force(e_p, e_v, none, acceleration_w, gains, mass)
    force, _ = limit_force(wanted, weight, gains.tan_tilt_max)
    rates = flat_rates(acceleration_w, jerk_w, snap_w, reference)
    nu = virtual_control(m, state, force, rates, reference.yaw, gains, weight=weight)
    omega_b, J = vector(state.angular_velocity_b), vector(model.inertia_b)
    torque = incremental_torque(m, nu, omega_b, airborne, J)
    finish(dot(force, axes[2]), torque, gains.yaw_torque_max, model, actuators)


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
        airborne=airborne,
        dt=dt,
        actuators=actuators[0],
    )


LAW = CompiledLaw(step, MEMORY)
