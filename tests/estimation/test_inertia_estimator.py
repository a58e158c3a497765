"""Sec. 5.4 for the inertia: three axes, with the motors' lag."""

from __future__ import annotations

import numpy as np
import pytest

from estimation.identification.inertia_estimator import InertiaEstimator
from quadrotor.records import ACTUATORS, new_state
from quadrotor.vehicle_model import mixing_matrix
from tests.support.dynamics import rk4_step

ARM, RATIO, LAG, MASS, DT = 0.25, 0.0174, 0.047, 1.308, 0.002
INERTIA = np.array([0.0154, 0.0150, 0.0250])
MIX = mixing_matrix(ARM, RATIO)


def fly(
    estimator: InertiaEstimator,
    seconds: float,
    *,
    noise: float = 0.0,
    offset: float = 0.0,
    airborne: bool = True,
    seed: int = 1,
) -> None:
    """Simulate a rigid body shaken about three axes under rate damping, with the motors' lag."""
    rng = np.random.default_rng(seed)
    x = np.zeros(13)
    x[6] = 1.0
    state, actuators = new_state(), np.zeros(1, ACTUATORS)
    roots = np.sqrt(np.full(4, MASS * 9.81 / 4))
    for k in range(round(seconds / DT)):
        t = k * DT
        wanted = np.array(
            [0.25 * np.sin(9 * t), 0.25 * np.sin(7 * t + 1), 0.07 * np.sin(4 * t)]
        ) - 0.05 * x[10:] * [1, 1, 0.5]
        thrusts = np.linalg.solve(MIX, [MASS * 9.81, *wanted])
        actuators["thrusts"][0] = thrusts
        roots += (1.0 - np.exp(-DT / LAG)) * (np.sqrt(thrusts) - roots)
        wrench = MIX @ np.square(roots)
        wrench[1] += offset
        rk4_step(x, wrench, np.zeros(3), MASS, INERTIA, DT)
        state["angular_velocity_b"] = x[10:] + noise * rng.standard_normal(3)
        estimator.step(state, actuators, airborne, DT)


def new_estimator(guess: float = 0.03, lag: float = LAG) -> InertiaEstimator:
    return InertiaEstimator(np.full(3, guess), arm=ARM, torque_ratio=RATIO, motor_time_constant=lag)


@pytest.mark.parametrize("guess", [0.008, 0.04])
def test_three_axes_converge_within_three_percent(guess: float) -> None:
    estimator = new_estimator(guess)
    assert not estimator.converged
    fly(estimator, 12.0, noise=0.01)
    np.testing.assert_allclose(estimator.inertia_b, INERTIA, rtol=0.03)
    assert estimator.converged


def test_a_constant_disturbance_does_not_spoil_it() -> None:
    estimator = new_estimator()
    fly(estimator, 12.0, offset=0.005)
    np.testing.assert_allclose(estimator.inertia_b, INERTIA, rtol=0.03)


def test_without_the_motors_lag_the_inertia_comes_out_too_large() -> None:
    estimator = new_estimator(lag=1e-5)
    fly(estimator, 12.0)
    assert estimator.inertia_b[0] > 1.05 * INERTIA[0]


def test_on_the_ground_nothing_is_learnt() -> None:
    estimator = new_estimator()
    fly(estimator, 2.0, airborne=False)
    np.testing.assert_array_equal(estimator.inertia_b, np.full(3, 0.03))
    assert not estimator.converged
