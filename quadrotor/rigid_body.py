"""Rigid-body dynamics with first-order motors: eqs. 2 and 3 and Sec. 5.3.

State is a STATE record and four rotor speeds, in motor-reference counts (speed is linear in
them). Integrated by the classical fourth-order Runge-Kutta scheme; the quaternion is renormalised
once a step.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.vehicle_model import GRAVITY, thrust_of_reference, wrench_of_thrusts

Array = npt.NDArray[np.float64]


@compiled
def derivative(x: Array, wrench: Array, force_w: Array, mass: float, J: Array, out: Array) -> None:
    """Time derivative of x = (p_w, v_w, q_wb, omega_b), shape (13,), into out.

    Args:
        wrench: (4,) thrust (N) along z_B and torques (N m) about body axes.
        force_w: (3,) further force (N) in world axes: drag, wind, ground contact.
        mass: kg.
        J: (3,) diagonal inertia, kg m^2.
    """
    w, a, b, c = x[6], x[7], x[8], x[9]
    p, q, r = x[10], x[11], x[12]
    for i in range(3):
        out[i] = x[3 + i]
    thrust = wrench[0] / mass
    out[3] = 2.0 * (a * c + w * b) * thrust + force_w[0] / mass
    out[4] = 2.0 * (b * c - w * a) * thrust + force_w[1] / mass
    out[5] = (1.0 - 2.0 * (a * a + b * b)) * thrust + force_w[2] / mass - GRAVITY
    out[6] = 0.5 * (-a * p - b * q - c * r)
    out[7] = 0.5 * (w * p + b * r - c * q)
    out[8] = 0.5 * (w * q + c * p - a * r)
    out[9] = 0.5 * (w * r + a * q - b * p)
    out[10] = (wrench[1] - (J[2] - J[1]) * q * r) / J[0]
    out[11] = (wrench[2] - (J[0] - J[2]) * r * p) / J[1]
    out[12] = (wrench[3] - (J[1] - J[0]) * p * q) / J[2]


@compiled
def motor_step(speeds: Array, references: Array, time_constant: float, dt: float) -> None:
    """Rotor speeds (counts) towards their references, exact for a held reference."""
    share = 1.0 - math.exp(-dt / time_constant)
    for i in range(4):
        speeds[i] += share * (references[i] - speeds[i])


@compiled
def rotor_wrench(speeds: Array, slope: float, offset: float, arm: float, ratio: float) -> Array:
    """Wrench (4,) of four rotors turning at `speeds` (counts); a stopped rotor gives nothing."""
    thrusts = np.empty(4)
    for i in range(4):
        thrusts[i] = thrust_of_reference(speeds[i], slope, offset) if speeds[i] > 1.0 else 0.0
    return wrench_of_thrusts(thrusts, arm, ratio)


@compiled
def rk4_step(x: Array, wrench: Array, force_w: Array, mass: float, J: Array, dt: float) -> None:
    """Advance x (13,) in place by dt (s), with wrench and force held."""
    k1, k2, k3, k4 = np.empty(13), np.empty(13), np.empty(13), np.empty(13)
    y = np.empty(13)
    derivative(x, wrench, force_w, mass, J, k1)
    for i in range(13):
        y[i] = x[i] + 0.5 * dt * k1[i]
    derivative(y, wrench, force_w, mass, J, k2)
    for i in range(13):
        y[i] = x[i] + 0.5 * dt * k2[i]
    derivative(y, wrench, force_w, mass, J, k3)
    for i in range(13):
        y[i] = x[i] + dt * k3[i]
    derivative(y, wrench, force_w, mass, J, k4)
    for i in range(13):
        x[i] += dt * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]) / 6.0
    length = math.sqrt(x[6] * x[6] + x[7] * x[7] + x[8] * x[8] + x[9] * x[9])
    for i in range(6, 10):
        x[i] /= length
