"""The geometric law with L1 adaptive augmentation.

Z. Wu, S. Cheng, P. Zhao, A. Gahlawat, K. A. Ackerman, A. Lakshmanan, C. Yang, J. Yu, N. Hovakimyan,
"L1Quad: L1 adaptive augmentation of geometric control for agile quadrotors with performance
guarantees", IEEE T-CST 2025 (arXiv 2302.07208); D. Hanover, P. Foehn, S. Sun, E. Kaufmann,
D. Scaramuzza, "Performance, precision, and payloads: adaptive nonlinear MPC for quadrotors", RA-L
2022 (arXiv 2109.04210). Both have a state predictor, a piecewise-constant adaptation law and a low
pass. For the partial state z = (v, omega) with error e = z^ - z and A_s = -a:

    predictor    z^' = f(z, u) + sigma^ - a e
    adaptation   sigma^ = -Phi^-1 mu,  Phi = A_s^-1 (exp(A_s T) - 1),  mu = exp(A_s T) e
    control      u_L1 = -C(s) sigma^,  C(s) = w / (s + w)

Departs from print: commands reach the predictor through the rotors' lag; and the force across z_B,
unmatched in print and left there, is taken off the desired force (`across`), since the geometric
law turns the thrust towards it, fed forward with its rate as that of a disturbance observer is.
"""

from __future__ import annotations

import math

import numpy as np

from control.disturbance_observer import RATE_POLE, modelled
from control.geometric_law import CONTROL_MEMORY, step_one
from control.laws import CompiledLaw, Own, Records, settings_type
from extensions.laws.parameters import GeometricL1Parameters
from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vectors import axes_of, dot, quaternion, vector

SETTINGS = settings_type(GeometricL1Parameters)
MEMORY = np.dtype(
    [
        ("running", "i8"),
        ("geometric", CONTROL_MEMORY),
        ("rotor_speeds", "f8", 4),  # counts, of the model
        ("velocity_w", "f8", 3),  # m/s, predicted
        ("angular_velocity_b", "f8", 3),  # rad/s, predicted
        ("push_w", "f8", 3),  # m/s^2, sigma^ of the force over the mass
        ("turn_b", "f8", 3),  # rad/s^2, sigma^ of the torque over the inertia
        ("filtered_push_w", "f8", 3),
        ("filtered_turn_b", "f8", 3),
        ("slow_push_w", "f8", 3),  # m/s^2, filtered_push_w behind RATE_POLE
    ],
    align=True,
)


@compiled(inner=True)
def adapt(m: Item, s: Item, state: Item, model: Item, actuators: Item, dt: float) -> None:
    """Advance predictor, adaptation and low pass over the last dt (s)."""
    target = quaternion(actuators.motor_references)
    push_w, turn = modelled(m, state, target, model, dt)
    a, b = s.force_pole, s.torque_pole
    # -Phi^-1 mu with A_s = -a: a exp(-a T) / (exp(-a T) - 1) e
    gain = a / math.expm1(a * dt)
    spin = b / math.expm1(b * dt)
    keep, keep_spin = -math.expm1(-s.force_cutoff * dt), -math.expm1(-s.torque_cutoff * dt)
    blur = -math.expm1(-RATE_POLE * dt)
    v, w = m.velocity_w, m.angular_velocity_b
    for i in range(3):
        v[i] += dt * (push_w[i] + m.push_w[i] - a * (v[i] - state.velocity_w[i]))
        m.push_w[i] = -gain * (v[i] - state.velocity_w[i])
        m.filtered_push_w[i] += keep * (m.push_w[i] - m.filtered_push_w[i])
        m.slow_push_w[i] += blur * (m.filtered_push_w[i] - m.slow_push_w[i])
        w[i] += dt * (turn[i] + m.turn_b[i] - b * (w[i] - state.angular_velocity_b[i]))
        m.turn_b[i] = -spin * (w[i] - state.angular_velocity_b[i])
        m.filtered_turn_b[i] += keep_spin * (m.turn_b[i] - m.filtered_turn_b[i])


@compiled(inner=True)
def rest(m: Item, state: Item, actuators: Item) -> None:
    """Begin the prediction at the measured motion, without a disturbance."""
    for i in range(4):
        m.rotor_speeds[i] = actuators.motor_references[i]
    for i in range(3):
        m.velocity_w[i] = state.velocity_w[i]
        m.angular_velocity_b[i] = state.angular_velocity_b[i]
        m.push_w[i] = m.turn_b[i] = m.filtered_push_w[i] = m.filtered_turn_b[i] = 0.0
        m.slow_push_w[i] = 0.0


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
    """Compute one tick; see `control.laws`."""
    if m.running == 0:
        m.running = 1
        for i in range(3):
            m.geometric.desired_attitude[i, i] = 1.0
        rest(m, state, actuators)
    if airborne:
        adapt(m, s, state, model, actuators, dt)
    else:
        rest(m, state, actuators)
    d = m.geometric.disturbance
    z_w = axes_of(quaternion(state.quaternion_wb))[2]
    matched = dot(z_w, vector(m.filtered_push_w))
    for i in range(3):
        push = m.filtered_push_w[i] if s.across == 1 else matched * z_w[i]
        d.force_w[i] = min(s.force_max, max(-s.force_max, model.mass * push))
        is_free = s.across == 1 and abs(model.mass * push) < s.force_max
        rate = RATE_POLE * model.mass * (m.filtered_push_w[i] - m.slow_push_w[i])
        d.force_rate_w[i] = rate if is_free else 0.0
        twist = model.inertia_b[i] * m.filtered_turn_b[i]
        d.torque_b[i] = min(s.torque_max, max(-s.torque_max, twist))
    # The adaptation replaces the integrals, which stay empty.
    step_one(m.geometric, state, reference, gains, model, False, dt, actuators)


@compiled(pointer=True)
def step(own: Own, records: Records, flown: bool, airborne: bool, dt: float) -> None:
    """Compute one tick; see `control.laws`."""
    memory, settings = own
    state, reference, gains, model, actuators = records
    m, s = memory.view(MEMORY)[0], settings.view(SETTINGS)[0]
    fly_one(m, s, state[0], reference[0], gains[0], model[0], airborne, dt, actuators[0])


LAW = CompiledLaw(step, MEMORY)
