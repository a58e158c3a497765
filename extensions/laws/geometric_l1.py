"""The geometric law with L1 adaptive augmentation.

Z. Wu, S. Cheng, P. Zhao, A. Gahlawat, K. A. Ackerman, A. Lakshmanan, C. Yang, J. Yu, N. Hovakimyan,
"L1Quad: L1 adaptive augmentation of geometric control for agile quadrotors with performance
guarantees", IEEE T-CST 2025 (arXiv 2302.07208); D. Hanover, P. Foehn, S. Sun, E. Kaufmann,
D. Scaramuzza, "Performance, precision, and payloads: adaptive nonlinear MPC for quadrotors", RA-L
2022 (arXiv 2109.04210). The estimate sigma^ of force and torque is in `adaptation`:

    control      u_L1 = -C(s) sigma^, of the thrust along z_B and of the torque

Departs from print: the force across z_B, unmatched in print and left there, is taken off the
desired force (`across`), since the geometric law turns the thrust towards it. Rates of the desired
attitude have its first two derivatives in them: without the second, the torque fed forward is not
that of the attitude, and on a fast course the error doubles.
"""

from __future__ import annotations

import numpy as np

from control.attitude_law import attitude_error, attitude_torque
from control.disturbance_observer import DISTURBANCE, RATE_POLE
from control.geometric_law import fed_forward
from control.laws import CompiledLaw, Own, Records, settings_type
from control.position_law import desired_force, limit_force
from extensions.laws.adaptation import ADAPTATION, adapt, bounded, rest
from extensions.laws.desired import desired_axes, finish, flat_rates
from extensions.laws.parameters import GeometricL1Parameters
from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vectors import Vector, axes_of, dot, quaternion, subtract, vector
from quadrotor.vehicle_model import GRAVITY

SETTINGS = settings_type(GeometricL1Parameters)
MEMORY = np.dtype(
    [
        ("running", "i8"),
        ("adaptation", ADAPTATION),
        ("disturbance", DISTURBANCE),  # the force across z_B, and the torque
        ("desired_attitude", "f8", (3, 3)),
    ],
    align=True,
)


@compiled(inner=True)
def cancelled(m: Item, s: Item, model: Item) -> Vector:
    """Write the disturbance that is subtracted from force and torque; return the second derivative
    of the force.

    It is over the mass, m/s^4. A force at its bound has no rate.
    """
    a, d, mass = m.adaptation, m.disturbance, model.mass
    curve = [0.0, 0.0, 0.0]
    for i in range(3):
        d.force_w[i] = bounded(mass * a.across_w[i], s.force_max) if s.across == 1 else 0.0
        is_free = s.across == 1 and abs(mass * a.across_w[i]) < s.force_max
        d.force_rate_w[i] = mass * a.rate_w[i] if is_free else 0.0
        curve[i] = RATE_POLE * (a.rate_w[i] - a.slow_rate_w[i]) if is_free else 0.0
        d.torque_b[i] = bounded(model.inertia_b[i] * a.filtered_turn_b[i], s.torque_max)
    return curve[0], curve[1], curve[2]


@compiled(inner=True)
def fly_one(
    m: Item,
    s: Item,
    state: Item,
    reference: Item,
    gains: Item,
    model: Item,
    airborne: bool,
    dt: float,
    actuators: Item,
) -> None:
    """Compute one tick; see `control.laws`. The adaptation replaces the integrals."""
    if m.running == 0 or not airborne:
        m.running = 1
        rest(m.adaptation, state, actuators)
    if airborne:
        tuning = (s.force_pole, s.torque_pole), (s.force_cutoff, s.torque_cutoff)
        adapt(m.adaptation, tuning, state, model, actuators, dt)
    mass, weight, none = model.mass, model.mass * GRAVITY, (0.0, 0.0, 0.0)
    curve = cancelled(m, s, model)
    axes, omega_b = axes_of(quaternion(state.quaternion_wb)), vector(state.angular_velocity_b)
    acceleration_w, jerk_w, snap_w, off = fed_forward(m.disturbance, reference, model, axes)
    e_p = subtract(vector(reference.position_w), vector(state.position_w))
    e_v = subtract(vector(reference.velocity_w), vector(state.velocity_w))
    wanted = desired_force(e_p, e_v, none, acceleration_w, gains, mass)
    force, _ = limit_force(wanted, weight, gains.tan_tilt_max)
    desired = desired_axes(m.desired_attitude, force, reference.yaw, weight)
    omega_d, turn_d = flat_rates(acceleration_w, jerk_w, subtract(snap_w, curve), reference)
    e_R, J = attitude_error(axes, desired), vector(model.inertia_b)
    torque = attitude_torque(
        axes, omega_b, desired, omega_d, turn_d, e_R, integral_b=none, gains=gains, J=J
    )
    thrust = dot(force, axes[2]) - bounded(mass * m.adaptation.lift, s.force_max)
    finish(thrust, subtract(torque, off), gains.yaw_torque_max, model, actuators)


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
