"""Quaternion kinematics, norm penalty, innovation and gains of eq. 12."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimation.attitude_filter import attitude_gains, attitude_innovation, to_world, turn_pose
from quadrotor.records import Array


def pose_of(rotation: Rotation) -> Array:
    return np.concatenate([[1.0, 2.0, 3.0], np.roll(rotation.as_quat(), 1)])


def rotation_of(pose: Array) -> Rotation:
    return Rotation.from_quat(np.roll(pose[3:], -1))


@pytest.mark.parametrize("size", [0.0, 1e-8, 1e-3, 1.0, 8.0])
def test_turning_is_the_exponential_of_the_body_rate(size: float, rng: np.random.Generator) -> None:
    for _ in range(20):
        start = Rotation.random(rng=rng)
        rate = rng.normal(size=3) * size
        pose = pose_of(start)
        turn_pose(pose, rate[0], rate[1], rate[2], 10.0, 0.1)
        wanted = start * Rotation.from_rotvec(0.1 * rate)
        assert (wanted.inv() * rotation_of(pose)).magnitude() < 1e-14 + 1e-14 * size
        np.testing.assert_array_equal(pose[:3], [1.0, 2.0, 3.0])


def test_a_constant_rate_gives_the_same_at_any_step() -> None:
    coarse, fine = pose_of(Rotation.identity()), pose_of(Rotation.identity())
    turn_pose(coarse, 0.3, -0.7, 1.1, 10.0, 1.0)
    for _ in range(500):
        turn_pose(fine, 0.3, -0.7, 1.1, 10.0, 0.002)
    np.testing.assert_allclose(fine, coarse, atol=1e-13)


@pytest.mark.parametrize("penalty", [1.0, 10.0, 1000.0])
@pytest.mark.parametrize("dt", [0.002, 0.1])
def test_norm_penalty_pulls_to_unit_length_and_turns_nothing(penalty: float, dt: float) -> None:
    start = Rotation.from_euler("ZYX", [1.0, 0.3, -0.2])
    for length in (0.98, 1.02):
        pose = pose_of(start)
        pose[3:] *= length
        turn_pose(pose, 0.0, 0.0, 0.0, penalty, dt)
        left = (np.linalg.norm(pose[3:]) - 1.0) / (length - 1.0)
        assert left == pytest.approx(math.exp(-2.0 * penalty * dt), abs=0.04)
        assert (start.inv() * rotation_of(pose)).magnitude() < 1e-14


def test_without_penalty_the_length_stays() -> None:
    pose = pose_of(Rotation.identity())
    pose[3:] *= 1.1
    turn_pose(pose, 1.0, 2.0, 3.0, 0.0, 0.01)
    assert np.linalg.norm(pose[3:]) == pytest.approx(1.1, rel=1e-14)


@pytest.mark.parametrize("degrees", [1e-6, 0.2, 30.0, 90.0, 150.0])
def test_innovation_is_the_sine_of_the_error_about_its_body_axis(
    degrees: float, rng: np.random.Generator
) -> None:
    estimated = Rotation.random(rng=rng)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    angle = math.radians(degrees)
    measured = pose_of(estimated * Rotation.from_rotvec(angle * axis))[3:]
    got = np.array(attitude_innovation(pose_of(estimated), measured))
    np.testing.assert_allclose(got, math.sin(angle) * axis, atol=1e-14)


def test_innovation_does_not_see_the_sign_of_a_quaternion(rng: np.random.Generator) -> None:
    for _ in range(20):
        pose, measured = pose_of(Rotation.random(rng=rng)), pose_of(Rotation.random(rng=rng))[3:]
        negated = pose * [1, 1, 1, -1, -1, -1, -1]
        wanted = attitude_innovation(pose, measured)
        assert attitude_innovation(pose, -measured) == pytest.approx(wanted, abs=1e-15)
        assert attitude_innovation(negated, measured) == pytest.approx(wanted, abs=1e-15)


def test_to_world_is_the_rotation_and_its_inverse(rng: np.random.Generator) -> None:
    R, v = Rotation.random(rng=rng), rng.normal(size=3)
    np.testing.assert_allclose(to_world(pose_of(R), 1.0, *v), R.apply(v), atol=1e-14)
    np.testing.assert_allclose(to_world(pose_of(R), -1.0, *v), R.inv().apply(v), atol=1e-14)


@pytest.mark.parametrize("rate", [10.0, 30.0, 76.0, 100.0, 500.0])
@pytest.mark.parametrize(("bandwidth", "bias"), [(62.8, 0.0), (3.0, 0.2), (0.4, 0.08)])
def test_error_poles_over_an_interval_are_those_of_the_continuous_law(
    rate: float, bandwidth: float, bias: float
) -> None:
    T = 1.0 / rate
    l_q, l_g = attitude_gains(bandwidth, bias, T)
    # Error (angle, bias): the angle grows by -T bias error; then angle -= l_q angle and bias += l_g
    # angle.
    F = np.array([[1.0, -T], [0.0, 1.0]])
    correction = np.array([[1.0 - l_q, 0.0], [l_g, 1.0]])
    poles = np.sort(np.linalg.eigvals(correction @ F).real)
    np.testing.assert_allclose(poles, np.sort(np.exp([-bandwidth * T, -bias * T])), atol=1e-7)


def test_the_printed_gain_times_period_would_diverge_where_ours_converges() -> None:
    assert abs(1.0 - 62.8 / 30.0) > 1.0
    assert 0.0 < 1.0 - attitude_gains(62.8, 0.0, 1.0 / 30.0)[0] < 1.0
