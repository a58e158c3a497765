"""The L1 estimate of disturbing force and torque: predictor, adaptation law and filters.

Z. Wu et al., "L1Quad: L1 adaptive augmentation of geometric control for agile quadrotors with
performance guarantees", IEEE T-CST 2025 (arXiv 2302.07208). For the partial state z = (v, omega)
with error e = z^ - z, A_s = -a and the sampling time T:

    predictor    z^' = f(z, u) + sigma^ - a e
    adaptation   sigma^ = -Phi^-1 mu,  Phi = A_s^-1 (exp(A_s T) - 1),  mu = exp(A_s T) e
    filter       C(s) = w / (s + w)

A constant disturbance is found but for the share a T, so slow poles a are the accurate ones. The
force is split as in print: along z_B, where thrust cancels it, and across. A wrong mass or a weak
rotor is all along z_B, and stays there as the vehicle turns; filtered in world axes it would lag.
Departs from print: commands reach the predictor through the rotors' lag.
"""

from __future__ import annotations

import math

import numpy as np

from control.disturbance_observer import RATE_POLE
from control.modelled_motion import modelled
from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vectors import axes_of, dot, quaternion, vector

Two = tuple[float, float]
ADAPTATION = np.dtype(
    [
        ("rotor_speeds", "f8", 4),  # counts, of the model
        ("velocity_w", "f8", 3),  # m/s, predicted
        ("angular_velocity_b", "f8", 3),  # rad/s, predicted
        ("velocity_error_w", "f8", 3),  # m/s, prediction minus state
        ("angular_velocity_error_b", "f8", 3),  # rad/s
        ("push_w", "f8", 3),  # m/s^2, sigma^ of the force over the mass
        ("turn_b", "f8", 3),  # rad/s^2, sigma^ of the torque over the inertia
        ("lift", "f8"),  # m/s^2, push along z_B, behind C(s)
        ("across_w", "f8", 3),  # m/s^2, push across z_B, behind C(s)
        ("filtered_turn_b", "f8", 3),
        ("slow_w", "f8", 3),  # m/s^2, across_w behind RATE_POLE
        ("rate_w", "f8", 3),  # m/s^3, of across_w
        ("slow_rate_w", "f8", 3),  # m/s^3, rate_w behind RATE_POLE
    ],
    align=True,
)


@compiled(inner=True)
def rest(m: Item, state: Item, actuators: Item) -> None:
    """Begin the prediction at the measured motion, without a disturbance."""
    m.lift = 0.0
    for i in range(4):
        m.rotor_speeds[i] = actuators.motor_references[i]
    for i in range(3):
        m.velocity_w[i] = state.velocity_w[i]
        m.angular_velocity_b[i] = state.angular_velocity_b[i]
        m.velocity_error_w[i] = m.angular_velocity_error_b[i] = 0.0
        m.push_w[i] = m.turn_b[i] = m.across_w[i] = m.filtered_turn_b[i] = 0.0
        m.slow_w[i] = m.rate_w[i] = m.slow_rate_w[i] = 0.0


@compiled(inner=True)
def adapt(
    m: Item, tuning: tuple[Two, Two], state: Item, model: Item, actuators: Item, dt: float
) -> None:
    """Advance predictor, adaptation and filters over the last dt (s).

    Args:
        tuning: poles a (1/s) and cutoffs w (rad/s), each of force and of torque.
    """
    poles, cutoffs = tuning
    axes = axes_of(quaternion(state.quaternion_wb))
    push_w, turn_b = modelled(m, state, quaternion(actuators.motor_references), model, dt)
    # -Phi^-1 mu with A_s = -a: a exp(-a T) / (exp(-a T) - 1) e
    gain, spin = poles[0] / math.expm1(poles[0] * dt), poles[1] / math.expm1(poles[1] * dt)
    keep, keep_spin = -math.expm1(-cutoffs[0] * dt), -math.expm1(-cutoffs[1] * dt)
    blur = -math.expm1(-RATE_POLE * dt)
    for i in range(3):
        m.velocity_w[i] += dt * (push_w[i] + m.push_w[i] - poles[0] * m.velocity_error_w[i])
        m.velocity_error_w[i] = m.velocity_w[i] - state.velocity_w[i]
        m.push_w[i] = -gain * m.velocity_error_w[i]
        error = m.angular_velocity_error_b[i]
        m.angular_velocity_b[i] += dt * (turn_b[i] + m.turn_b[i] - poles[1] * error)
        m.angular_velocity_error_b[i] = m.angular_velocity_b[i] - state.angular_velocity_b[i]
        m.turn_b[i] = -spin * m.angular_velocity_error_b[i]
        m.filtered_turn_b[i] += keep_spin * (m.turn_b[i] - m.filtered_turn_b[i])
    lift = dot(vector(m.push_w), axes[2])
    m.lift += keep * (lift - m.lift)
    for i in range(3):
        m.across_w[i] += keep * (m.push_w[i] - lift * axes[2][i] - m.across_w[i])
        m.slow_w[i] += blur * (m.across_w[i] - m.slow_w[i])
        m.rate_w[i] = RATE_POLE * (m.across_w[i] - m.slow_w[i])
        m.slow_rate_w[i] += blur * (m.rate_w[i] - m.slow_rate_w[i])


@compiled(inner=True)
def bounded(value: float, bound: float) -> float:
    """Return a value within +-bound."""
    return min(bound, max(-bound, value))
