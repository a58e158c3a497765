"""The torque of a drag beside the centre of mass, by the force that the accelerometer feels.

Across z_B the rotors give no force, so what an accelerometer feels there is drag, gusts included:
J_x omega_x' = tau_x - l F_y and J_y omega_y' = tau_y + l F_x for a drag that acts at the height l.
Inertia and lever follow together by least squares, each axis by itself, of torques, accelerations
and forces behind the same filters. A gust that moves the vehicle is then no error of the torque.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.identification.inertia_estimator import InertiaParameters
from quadrotor.compiled import compiled
from quadrotor.vehicle_model import Array, wrench_of_thrusts

SETTLING = 2.0
"""Time, in s, until filters and motors' lag have forgotten their start."""


def drag_torques(
    steps: Array,
    rates_b: Array,
    thrusts: Array,
    forces_b: Array,
    *,
    arm: float,
    torque_ratio: float,
    motor_time_constant: float,
) -> Array:
    """Return the torque (N, 3) of the drag in N m, zero where it shows in no torque.

    Args:
        steps: (N,) s, between the ticks.
        rates_b: (N + 1, 3) rad/s.
        thrusts: (N + 1, 4) N, commanded from each tick on.
        forces_b: (N + 1, 3) m/s², specific force.
        arm, torque_ratio: m. motor_time_constant: s.
    """
    p = InertiaParameters()
    torques = np.empty((len(steps), 3))
    _follow(steps, thrusts, torques, motor_time_constant, arm, torque_ratio)
    signals = np.concatenate([np.diff(rates_b, axis=0) / steps[:, None], torques, forces_b[1:]], 1)
    _filter(steps, signals, p.filter_pole, p.washout_pole)
    kept = np.cumsum(steps) > SETTLING
    acceleration, torque, force = (signals[kept, k : k + 3] for k in (0, 3, 6))
    out = np.zeros((len(steps), 3))
    for axis in (0, 1):
        unknown = np.stack([torque[:, axis], force[:, 1 - axis]], 1)
        per_torque, per_force = np.linalg.lstsq(unknown, acceleration[:, axis], rcond=None)[0]
        if per_torque > 0.0:
            out[:, axis] = per_force / per_torque * forces_b[1:, 1 - axis]
    return out


@compiled
def _follow(
    steps: Array, thrusts: Array, torques: Array, lag: float, arm: float, ratio: float
) -> None:
    """Write the torques of the rotors, which follow their commands with the motors' lag."""
    root = np.sqrt(np.maximum(thrusts[0], 0.0))
    for k in range(len(steps)):
        root += -math.expm1(-steps[k] / lag) * (np.sqrt(np.maximum(thrusts[k], 0.0)) - root)
        a, b, c, d = root[0], root[1], root[2], root[3]
        wrench = wrench_of_thrusts((a * a, b * b, c * c, d * d), arm, ratio)
        for i in range(3):
            torques[k, i] = wrench[i + 1]


@compiled
def _filter(steps: Array, signals: Array, pole: float, washout: float) -> None:
    """Filter the columns (N, M) by a / (s + a) and s / (s + b), in place."""
    fast, slow = np.zeros(signals.shape[1]), np.zeros(signals.shape[1])
    for k in range(len(steps)):
        fast += -math.expm1(-pole * steps[k]) * (signals[k] - fast)
        slow += -math.expm1(-washout * steps[k]) * (fast - slow)
        signals[k] = fast - slow
