"""The rigid-body dynamics of quadrotor.rigid_body on arrays, as tests call them."""

from __future__ import annotations

import numpy as np

from quadrotor.compiled import compiled
from quadrotor.rigid_body import (
    _lean,
    _spin,
    _turning,
    gyroscopic_ratios,
    motion_of,
    motor_share,
    rk4,
    rotors,
    store_motion,
)
from quadrotor.vectors import quaternion, scale, store, times, vector
from quadrotor.vehicle_model import GRAVITY
from tests.support.arrays import Array


@compiled
def derivative(x: Array, wrench: Array, force_w: Array, mass: float, J: Array, out: Array) -> None:
    """Write the time derivative of x = (p_w, v_w, q_wb, omega_b), shape (13,), into out.

    Args:
        wrench: (4,) thrust (N) along z_B and torques (N m) about body axes.
        force_w: (3,) further force (N) in world axes: drag, wind, ground contact.
        mass: kg.
        J: (3,) diagonal inertia, kg m^2.
    """
    q, w = quaternion(x[6:10]), vector(x[10:13])
    lean, turning = _lean(q), _turning(q, w)
    thrust = wrench[0] / mass
    inverse = (1.0 / J[0], 1.0 / J[1], 1.0 / J[2])
    store(vector(x[3:6]), out[0:3])
    out[3] = 2.0 * lean[0] * thrust + force_w[0] / mass
    out[4] = 2.0 * lean[1] * thrust + force_w[1] / mass
    out[5] = (1.0 - 2.0 * lean[2]) * thrust + force_w[2] / mass - GRAVITY
    for i in range(4):
        out[6 + i] = 0.5 * turning[i]
    turn = times(vector(wrench[1:4]), inverse)
    store(_spin(w, turn, gyroscopic_ratios(vector(J), inverse)), out[10:13])


@compiled
def rk4_step(x: Array, wrench: Array, force_w: Array, mass: float, J: Array, dt: float) -> None:
    """Advance x (13,) in place by dt (s), with constant wrench and force; see `derivative`."""
    inverse = (1.0 / J[0], 1.0 / J[1], 1.0 / J[2])
    ratios = gyroscopic_ratios(vector(J), inverse)
    push_w = scale(1.0 / mass, vector(force_w))
    lift, turn = wrench[0] / mass, times(vector(wrench[1:4]), inverse)
    lifts, turns = (lift, lift, lift), (turn, turn, turn)
    store_motion(rk4(motion_of(x), lifts, push_w, 0.0, turns, ratios, dt), x)


@compiled
def motor_step(speeds: Array, references: Array, time_constant: float, dt: float) -> None:
    """Move rotor speeds (counts) towards their references, exact for a held reference."""
    share = motor_share(time_constant, dt)
    for i in range(4):
        speeds[i] += share * (references[i] - speeds[i])


@compiled
def rotor_wrench(speeds: Array, slope: float, offset: float, arm: float, ratio: float) -> Array:
    """Return the wrench as `rotors` does, on arrays (4,)."""
    wrench = rotors((speeds[0], speeds[1], speeds[2], speeds[3]), slope, offset, arm, ratio)
    out = np.empty(4)
    for i in range(4):
        out[i] = wrench[i]
    return out
