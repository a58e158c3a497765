"""Lighthouse sweeps in the error-state filter: model, start, accuracy, a moved station."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from estimation.error_state.estimator import ErrorStateEstimator
from estimation.parameters import EstimationParameters
from estimation.poses.sweep_pose import sweep_pose
from estimation.sweep_angles import plane_numbers, swept
from quadrotor.errors import DegenerateGeometryError, MeasurementError, UndeterminedStartError
from quadrotor.plain_rotations import matrices_of
from quadrotor.records import ESTIMATE, IMU_SAMPLE, Array, new_state
from tests.support.sweeps import sweeps_of


def fly(
    estimator: ErrorStateEstimator,
    seconds: float,
    *,
    moved: Array | None = None,
    turned: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0),
    before: Callable[[float], None] = lambda t: None,
) -> Array:
    """Fly a level circle; return the position errors (N, 3) of the last half.

    Four planes sweep at 50 Hz each. `moved` is how far station 0 is from the filter's place for it,
    from the middle on; `turned` are errors of the planes' angles, rad. `before` is called before
    each sample.
    """
    rng, state, estimate = np.random.default_rng(5), new_state(), np.zeros(1, ESTIMATE)
    radius, rate, errors = 0.5, 1.0, []
    for k in range(1, round(400 * seconds)):
        t = k / 400
        before(t)
        c, s = math.cos(rate * t), math.sin(rate * t)
        position = np.array([radius * (c - 1.0), radius * s, 1.0])
        imu = np.zeros(1, IMU_SAMPLE)
        imu["stamp_ns"] = round(t * 1e9)
        imu["specific_force_b"] = (-radius * rate**2 * c, -radius * rate**2 * s, 9.80665)
        imu["specific_force_b"] += 0.07 * rng.normal(size=3)
        imu["angular_velocity_b"] = 0.007 * rng.normal(size=3)
        estimator.predict(imu, 1 / 400, state)
        if k % 2 == 0:
            number = (k // 2) % 4
            seen_from = position
            if moved is not None and number < 2 and t > 0.5 * seconds:
                seen_from = position - moved
            frame = sweeps_of(number, round(t * 1e9), seen_from, rng)
            frame["angle"] += turned[number]
            try:
                estimator.correct_sweeps(frame, estimate)
            except UndeterminedStartError:
                assert t < 0.1
        if t > 0.5 * seconds:
            errors.append(state["position_w"][0] - position)
    return np.array(errors)


def test_gradient_of_the_sweep_angle_is_that_of_finite_differences() -> None:
    rng = np.random.default_rng(1)
    for number in range(4):
        plane = plane_numbers(sweeps_of(number, 0, np.array([0.0, 0.0, 1.0]), rng)[0])
        for place in rng.uniform((-1, -1, 0.2), (1, 1, 2), (20, 3)):
            angle, gradient = swept(plane, tuple(place))
            assert math.isfinite(angle)
            for i in range(3):
                step = 1e-6 * np.eye(3)[i]
                ahead, behind = (swept(plane, tuple(place + w * step))[0] for w in (1, -1))
                assert gradient[i] == pytest.approx((ahead - behind) / 2e-6, abs=1e-7)


def test_tilted_plane_holds_the_points_at_its_angle() -> None:
    """The plane through the rotor's axis is turned by alpha and tilted by t about that line."""
    plane = np.zeros(12)
    plane[3], plane[7] = 1.0, math.pi / 6
    alpha, t = 0.4, math.pi / 6
    along = np.array([math.cos(alpha), math.sin(alpha), 0.0])
    up = np.array([math.sin(t) * math.sin(alpha), -math.sin(t) * math.cos(alpha), math.cos(t)])
    for place in (2.0 * along + 0.7 * up, 3.0 * along - 0.5 * up):
        assert swept(plane, tuple(place))[0] == pytest.approx(alpha)
    assert math.isnan(swept(plane, (0.0, 0.0, 1.0))[0])


def test_pose_from_the_planes_of_two_stations_within_its_covariance() -> None:
    rng, place = np.random.default_rng(2), np.array([0.3, -0.2, 0.1])
    frames = [sweeps_of(number, 0, place, rng)[0] for number in range(4)]
    found = sweep_pose(frames)
    missed = np.concatenate([found.position_w - place, 2.0 * found.quaternion_wb[1:]])
    assert missed @ np.linalg.solve(found.covariance, missed) < 22.5  # chi-square of 6, 0.1 %
    assert np.allclose(matrices_of(found.quaternion_wb[None])[0], np.eye(3), atol=0.3)
    with pytest.raises(DegenerateGeometryError, match="one base station"):
        sweep_pose(frames[:2])


def test_pose_from_planes_that_are_turned_by_milliradians() -> None:
    rng, place = np.random.default_rng(2), np.array([0.3, -0.2, 0.1])
    frames = [sweeps_of(number, 0, place, rng)[0].copy() for number in range(4)]
    for frame, turned in zip(frames, (0.008, 0.008, 0.008, -0.008), strict=True):
        frame["angle"] += turned
    with pytest.raises(DegenerateGeometryError, match="no pose fits the sweeps"):
        sweep_pose(frames)
    found = sweep_pose(frames, 0.008)
    missed = np.concatenate([found.position_w - place, 2.0 * found.quaternion_wb[1:]])
    assert missed @ np.linalg.solve(found.covariance, missed) < 22.5  # chi-square of 6, 0.1 %
    assert np.abs(missed[:3]).max() < 0.1


def test_filter_on_sweeps_starts_by_itself_and_is_as_good_as_its_covariance() -> None:
    p = EstimationParameters()
    estimator = ErrorStateEstimator(p)
    errors = fly(estimator, 6.0)
    rms, told = np.sqrt((errors**2).sum(axis=1).mean()), estimator.deviations.position
    assert 0.5 * told < rms < 1.6 * told  # the bound of the filter's own Riccati equation
    assert rms < 0.002
    assert estimator.inconsistency == ""
    assert float(estimator.memory["refused_share"][0]) < 0.02


def test_an_error_common_to_the_angles_of_a_plane_is_weighted_once() -> None:
    """Stations that are surveyed to a centimetre turn each plane by milliradians."""
    p = EstimationParameters()
    turned = (0.0015, 0.0015, -0.0015, 0.0015)
    trusting = ErrorStateEstimator(p)
    apart = np.linalg.norm(fly(trusting, 6.0, turned=turned), axis=1)
    p.error_state.sweep_plane_sigma = 0.1
    estimator = ErrorStateEstimator(p)
    errors = np.linalg.norm(fly(estimator, 6.0, turned=turned), axis=1)
    assert float(estimator.memory["refused_share"][0]) == 0.0
    assert errors.max() < 0.01 < apart.max()
    assert errors.max() < 4.0 * estimator.deviations.position
    assert apart.max() > 10.0 * trusting.deviations.position


def test_a_filter_that_most_planes_contradict_restarts_although_one_agrees() -> None:
    """Along a plane of light, its angles do not change."""
    estimator = ErrorStateEstimator(EstimationParameters())
    memory, moved_at = estimator.memory[0], 1.5

    class Moved:
        """Moves the estimate along the second plane, once."""

        done = False

        def __call__(self, t: float) -> None:
            if self.done or t < moved_at:
                return
            self.done = True
            place = memory["base"][:3].copy()
            plane = plane_numbers(sweeps_of(1, 0, place, np.random.default_rng(1))[0])
            across = np.array(swept(plane, tuple(place))[1])
            away = np.cross(across, [0.0, 0.0, 1.0])
            away *= 0.3 / np.linalg.norm(away)
            for name in ("base", "now"):
                memory[name][:3] += away
            memory["after_state"][:, :3] += away

    errors = fly(estimator, 5.0, before=Moved())
    assert len(estimator.restarts) == 1
    assert np.linalg.norm(errors, axis=1).max() < 0.02
    assert estimator.inconsistency == ""


def test_moved_base_station_is_refused_or_told() -> None:
    estimator = ErrorStateEstimator(EstimationParameters())
    fly(estimator, 4.0, moved=np.array([0.1, 0.0, 0.0]))
    assert estimator.inconsistency or float(estimator.memory["refused_share"][0]) > 0.2


def test_unusable_sweeps_are_refused_and_odd_numbers_of_sensors_are_not() -> None:
    rng, estimate = np.random.default_rng(3), np.zeros(1, ESTIMATE)
    estimator = ErrorStateEstimator(EstimationParameters())
    fly(estimator, 1.0)
    applied = int(estimator.memory["applied"][0])
    place = estimator.memory["now"][0, :3]
    stamp_ns = int(estimator.memory["stamp_ns"][0])
    estimator.correct_sweeps(sweeps_of(0, stamp_ns, place, rng, sensors=3), estimate)
    assert int(estimator.memory["applied"][0]) == applied + 1
    for spoil in ("angle", "sensor_b"):
        frame = sweeps_of(0, stamp_ns, place, rng)
        frame[spoil][0, 0] = math.nan
        with pytest.raises(MeasurementError, match="sweep of 4 sensors"):
            estimator.correct_sweeps(frame, estimate)
