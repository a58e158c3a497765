"""Gains and prediction of eq. 11."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimation.translation_observer import acceleration_of, move_pose, translation_gains


@pytest.mark.parametrize("rate", [10.0, 20.0, 30.0, 76.0, 100.0, 500.0])
@pytest.mark.parametrize(
    ("bandwidth", "bias"), [(63.15, 0.0), (63.15, 5.0), (8.0, 0.3), (8.0, 8.0), (2.5, 0.15)]
)
def test_error_poles_over_an_interval_are_those_of_the_continuous_law(
    rate: float, bandwidth: float, bias: float
) -> None:
    T = 1.0 / rate
    L = np.array(translation_gains(bandwidth, bias, T))
    F = np.array([[1.0, T, 0.5 * T * T], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
    got = np.poly((np.eye(3) - np.outer(L, [1.0, 0.0, 0.0])) @ F)
    wanted = np.poly(np.exp(-np.array([bandwidth, bandwidth, bias]) * T))
    # Coefficients, not roots: those of a double pole lose half the digits.
    np.testing.assert_allclose(got, wanted, atol=1e-13)


def test_without_bias_the_gains_are_those_of_the_double_pole() -> None:
    p = math.exp(-63.15 * 0.01)
    position, velocity, acceleration = translation_gains(63.15, 0.0, 0.01)
    assert position == pytest.approx(1.0 - p * p, rel=1e-14)
    assert velocity == pytest.approx((1.0 - p) ** 2 / 0.01, rel=1e-14)
    assert acceleration == 0.0


def test_frequent_measurements_give_the_printed_gains() -> None:
    T = 1e-7
    position, velocity, _ = translation_gains(63.15, 0.0, T)
    assert position / T == pytest.approx(126.3, rel=1e-4)
    assert velocity / T == pytest.approx(3987.3, rel=3e-4)


def test_after_a_long_gap_the_measured_position_is_taken_whole() -> None:
    position, velocity, acceleration = translation_gains(8.0, 0.3, 5.0)
    assert position == pytest.approx(1.0, abs=1e-12)
    assert 0.0 < velocity < 2.0 / 5.0
    assert 0.0 < acceleration < 1.0 / 25.0


def test_at_rest_the_acceleration_is_zero_in_any_attitude(rng: np.random.Generator) -> None:
    bias = rng.normal(size=3)
    for _ in range(10):
        R = Rotation.random(rng=rng)
        pose = np.concatenate([np.zeros(3), np.roll(R.as_quat(), 1)])
        force = R.inv().apply([0.0, 0.0, 9.81]) + bias
        np.testing.assert_allclose(acceleration_of(pose, force, bias), 0.0, atol=1e-13)


def test_prediction_is_exact_for_a_linear_acceleration() -> None:
    start, jerk, dt = np.array([1.0, -2.0, 0.5]), np.array([3.0, 1.0, -4.0]), 0.1
    end = start + jerk * dt
    pose, velocity = np.array([0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0]), np.array([0.5, 0.6, 0.7])
    p0, v0 = pose[:3].copy(), velocity.copy()
    move_pose(pose, velocity, tuple(start), tuple(end), dt)
    np.testing.assert_allclose(velocity, v0 + start * dt + jerk * dt**2 / 2, rtol=1e-13)
    wanted = p0 + v0 * dt + start * dt**2 / 2 + jerk * dt**3 / 6
    np.testing.assert_allclose(pose[:3], wanted, rtol=1e-13)
    np.testing.assert_array_equal(pose[3:], [1.0, 0.0, 0.0, 0.0])
