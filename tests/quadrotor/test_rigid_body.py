"""Dynamics: known motions, conserved quantities, order of the integrator."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest

from quadrotor.rigid_body import motor_share
from quadrotor.rotations import quaternion_exp, quaternion_to_matrix, rotate
from quadrotor.vehicle_model import VehicleModel
from tests.support.arrays import Array
from tests.support.dynamics import derivative, motor_step, rk4_step, rotor_wrench

MASS, G = 1.308, 9.81
J = np.array([0.0154, 0.0160, 0.0250])
ZERO = np.zeros(3)


def state(
    velocity: npt.ArrayLike = (0, 0, 0),
    rotation: npt.ArrayLike = (0, 0, 0),
    w: npt.ArrayLike = (0, 0, 0),
) -> Array:
    q = quaternion_exp(np.array(rotation, dtype=float))
    return np.concatenate([np.zeros(3), velocity, q, np.array(w, dtype=float)])


def run(
    x: Array, wrench: npt.ArrayLike, seconds: float, dt: float = 0.001, force: Array = ZERO
) -> Array:
    x = x.copy()
    for _ in range(round(seconds / dt)):
        rk4_step(x, np.array(wrench, dtype=float), np.array(force, dtype=float), MASS, J, dt)
    return x


def test_hover_thrust_holds_the_vehicle_still() -> None:
    x = run(state(), [MASS * G, 0, 0, 0], 1.0)
    np.testing.assert_allclose(x, state(), atol=1e-12)


def test_without_thrust_it_falls_as_a_stone() -> None:
    x = run(state(velocity=(1, 0, 2)), [0, 0, 0, 0], 1.0)
    np.testing.assert_allclose(x[:3], [1.0, 0.0, 2.0 - G / 2], atol=1e-9)
    np.testing.assert_allclose(x[3:6], [1.0, 0.0, 2.0 - G], atol=1e-9)


def test_thrust_acts_along_the_body_z_axis() -> None:
    rng = np.random.default_rng(11)
    print("seed 11")
    for _ in range(20):
        x, out = state(rotation=rng.normal(size=3)), np.empty(13)
        derivative(x, np.array([20.0, 0, 0, 0]), np.array([0.1, 0.2, 0.3]), MASS, J, out)
        z_b = quaternion_to_matrix(x[6:10])[:, 2]
        expected = (20.0 * z_b + [0.1, 0.2, 0.3]) / MASS - [0, 0, G]
        np.testing.assert_allclose(out[3:6], expected, atol=1e-12)


def test_torque_about_an_axis_turns_about_it() -> None:
    for axis in range(3):
        wrench = np.zeros(4)
        wrench[1 + axis] = 0.01
        x = run(state(), wrench, 0.5)
        expected = np.zeros(3)
        expected[axis] = 0.01 / J[axis] * 0.5
        np.testing.assert_allclose(x[10:13], expected, atol=1e-9)
        angle = np.zeros(3)
        angle[axis] = 0.5 * 0.01 / J[axis] * 0.25
        np.testing.assert_allclose(x[6:10], quaternion_exp(angle), atol=1e-9)


def test_without_torque_energy_and_world_angular_momentum_are_kept() -> None:
    before = state(rotation=(0.3, 0.2, -0.1), w=(3.0, -2.0, 4.0))
    after = run(before, [0, 0, 0, 0], 2.0)
    momenta = [rotate(x[6:10], J * x[10:13]) for x in (before, after)]
    np.testing.assert_allclose(momenta[1], momenta[0], atol=1e-8)
    energies = [0.5 * (J * x[10:13] ** 2).sum() for x in (before, after)]
    assert energies[1] == pytest.approx(energies[0], rel=1e-8)
    assert np.abs(after[10:13] - before[10:13]).max() > 0.5  # it did tumble


def test_the_gyroscopic_term_is_that_of_eq_3() -> None:
    rng = np.random.default_rng(12)
    print("seed 12")
    w, torque, out = rng.normal(size=3), rng.normal(size=3), np.empty(13)
    derivative(state(w=w), np.array([0.0, *torque]), ZERO, MASS, J, out)
    np.testing.assert_allclose(J * out[10:13] + np.cross(w, J * w), torque, atol=1e-12)


def classical(x: Array, wrench: Array, force: Array, dt: float) -> Array:
    """Integrate all 13 numbers at once by the scheme in textbooks."""

    def rate(y: Array) -> Array:
        out = np.empty(13)
        derivative(y, wrench, force, MASS, J, out)
        return out

    k1 = rate(x)
    k2 = rate(x + 0.5 * dt * k1)
    k3 = rate(x + 0.5 * dt * k2)
    k4 = rate(x + dt * k3)
    y = x + dt * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
    y[6:10] /= np.linalg.norm(y[6:10])
    return y


def test_the_step_is_the_classical_scheme_on_the_derivative() -> None:
    rng = np.random.default_rng(13)
    print("seed 13")
    for dt in (1e-3, 1e-2, 0.1):
        for _ in range(20):
            x = state(rng.normal(size=3), rng.normal(size=3), 5.0 * rng.normal(size=3))
            x[:3] = rng.normal(size=3)
            wrench, force = rng.normal(size=4) * [20, 0.3, 0.3, 0.1], rng.normal(size=3)
            expected = classical(x, wrench, force, dt)
            rk4_step(x, wrench, force, MASS, J, dt)
            np.testing.assert_allclose(x, expected, rtol=1e-12, atol=1e-12)


def test_halving_the_step_divides_the_error_by_16() -> None:
    start = state(velocity=(1, 2, 3), rotation=(0.3, 0.2, 0.1), w=(3.0, -2.0, 1.0))
    wrench = [15.0, 0.1, -0.05, 0.02]
    exact = run(start, wrench, 0.4, dt=0.0005)
    errors = [np.abs(run(start, wrench, 0.4, dt=dt) - exact).max() for dt in (0.02, 0.01, 0.005)]
    for coarse, fine in pairwise(errors):
        assert 13.0 < coarse / fine < 19.0
    assert errors[-1] > 1e-12  # not just rounding


def test_without_thrust_the_energy_of_a_tumbling_stone_is_kept() -> None:
    before = state(velocity=(1, 0, 2), rotation=(0.3, 0.2, -0.1), w=(3.0, -2.0, 4.0))
    after = run(before, [0, 0, 0, 0], 2.0)

    def energy(x: Array) -> float:
        motion = 0.5 * MASS * (x[3:6] ** 2).sum() + 0.5 * (J * x[10:13] ** 2).sum()
        return float(motion + MASS * G * x[2])

    assert energy(after) == pytest.approx(energy(before), rel=1e-9)
    assert after[2] < -10.0  # it did fall


def test_the_quaternion_stays_of_unit_length() -> None:
    x = run(state(w=(10.0, -8.0, 6.0)), [MASS * G, 0, 0, 0], 2.0, dt=0.004)
    assert np.linalg.norm(x[6:10]) == pytest.approx(1.0, abs=1e-14)


def test_motors_reach_63_percent_after_one_time_constant_at_any_step() -> None:
    for steps in (1, 7, 100):
        speeds = np.array([30.0, 30.0, 130.0, 0.0])
        for _ in range(steps):
            motor_step(speeds, np.array([130.0, 30.0, 30.0, 100.0]), 0.047, 0.047 / steps)
        share = 1 - np.exp(-1)
        assert motor_share(0.047, 0.047) == pytest.approx(share)
        expected = [30 + 100 * share, 30.0, 130 - 100 * share, 100 * share]
        np.testing.assert_allclose(speeds, expected, rtol=1e-12)


def test_stopped_rotors_give_nothing_and_hovering_ones_the_weight() -> None:
    m = VehicleModel()
    law = (m.motor_slope, m.motor_offset, m.arm, m.torque_ratio)
    assert not rotor_wrench(np.zeros(4), *law).any()
    wrench = rotor_wrench(np.full(4, 127.427), *law)
    np.testing.assert_allclose(wrench, [MASS * G, 0, 0, 0], atol=1e-3)
