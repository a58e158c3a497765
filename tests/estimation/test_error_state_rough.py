"""The error-state filter with its default noise on sensors as rough as those of real flights."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimation.error_state.estimator import ErrorStateEstimator
from estimation.error_state.memory import ATTITUDE, FORCE, POSITION, RATE
from quadrotor.errors import MeasurementError
from quadrotor.records import (
    BEARINGS_SAMPLE,
    ESTIMATE,
    IMU_SAMPLE,
    POSE_SAMPLE,
    Array,
    Record,
    new_state,
)

Spoil = Callable[[float, Record], bool]
"""Function of the time (s) and a pose, which it changes in place; False if the pose is missing."""
HARMONICS = np.array([83.0, 91.0, 166.0, 182.0])
"""Hz, of two rotors: above half the rate of poses, below half that of samples."""
BEACONS = np.array([[1.0, 1.0, 0.1], [-1.0, 1.0, 0.1], [-1.0, -1.0, 0.1], [1.0, -1.0, 0.1]])
SIGMA = math.radians(1.5)


class Rough:
    """Flight of the laboratory's figure 8, at a multiple of the default noise.

    Args:
        vibration: m/s^2 rms on each axis; as many tenths of rad/s.
        imu, pose: factors on the noise.
    """

    def __init__(
        self,
        laboratory: Any,
        seed: int,
        *,
        seconds: float = 10.0,
        vibration: float = 0.0,
        imu: float = 1.0,
        pose: float = 1.0,
    ) -> None:
        self.truth = truth = laboratory.figure_eight(seconds, 500.0)
        self.rng = rng = np.random.default_rng(seed)
        n = len(truth.t)
        phases = rng.uniform(0.0, 2.0 * math.pi, (2, 4, 3))
        angle = 2.0 * math.pi * truth.t[:, None, None] * HARMONICS[:, None]
        force, rate = (np.sin(angle + p).sum(axis=1) / math.sqrt(2.0) for p in phases)
        self.force = truth.specific_force_b + vibration * force
        self.force += imu * 0.05 * rng.normal(size=(n, 3))
        self.rate = truth.angular_velocity_b + 0.1 * vibration * rate
        self.rate += imu * math.radians(0.3) * rng.normal(size=(n, 3))
        wobble = Rotation.from_rotvec(pose * math.radians(0.3) * rng.normal(size=(n, 3)))
        self.position = truth.position_w + pose * 0.0015 * rng.normal(size=(n, 3))
        self.quaternion = np.roll((truth.attitude * wobble).as_quat(), 1, axis=1)
        self.estimator = ErrorStateEstimator()
        self.error = np.full(n, np.nan)  # m
        self.seen_from = np.zeros((n, 3))  # m, from the vehicle to where frames see it

    def fly(self, spoil: Spoil = lambda t, pose: True, bearings: bool = False) -> Rough:
        imu, pose, state = np.zeros(1, IMU_SAMPLE), np.zeros(1, POSE_SAMPLE), new_state()
        estimate, truth = np.zeros(1, ESTIMATE), self.truth
        for k, t in enumerate(truth.t.tolist()):
            stamp_ns = 1_000_000_000 + k * 2_000_000
            imu[0] = stamp_ns, self.force[k], self.rate[k]
            self.estimator.predict(imu, 0.002, state)
            self.error[k] = np.linalg.norm(state["position_w"][0] - truth.position_w[k])
            pose[0] = stamp_ns, self.position[k], self.quaternion[k]
            if bearings and k % 17 == 16:
                self.estimator.correct_bearings(self._frame(stamp_ns, k), estimate)
            elif (k == 0 or (not bearings and k % 5 == 0)) and spoil(t, pose):
                self.estimator.correct(pose, estimate)
        return self

    def _frame(self, stamp_ns: int, k: int) -> Record:
        frame, truth = np.zeros(1, BEARINGS_SAMPLE), self.truth
        away = truth.attitude[k].inv().apply(BEACONS - truth.position_w[k] - self.seen_from[k])
        away /= np.linalg.norm(away, axis=1)[:, None]
        away += SIGMA * self.rng.normal(size=away.shape)
        away /= np.linalg.norm(away, axis=1)[:, None]
        frame["stamp_ns"], frame["count"], frame["sigma"] = stamp_ns, 4, SIGMA
        frame["beacon_w"][0, :4], frame["bearing_b"][0, :4] = BEACONS, away
        return frame

    def rms(self, after: float, until: float = math.inf) -> float:
        """Return the rms position error between two times, m."""
        used = (self.truth.t >= after) & (self.truth.t < until)
        return float(np.sqrt((self.error[used] ** 2).mean()))

    @property
    def refused(self) -> float:
        """Return the share of poses that were refused."""
        used, *_, refused = self.estimator.memory["outcomes"][0].tolist()
        return float(refused / (used + refused))

    @property
    def scale(self) -> Array:
        """Return the factors on the variances, by kind of noise."""
        scale: Array = self.estimator.memory["noise_scale"][0]
        return scale


@pytest.fixture
def seed(request: pytest.FixtureRequest) -> int:
    found = zlib.crc32(request.node.name.encode())
    print(f"seed {found}")
    return found


def outliers(rough: Rough, share: float) -> Spoil:
    def spoil(t: float, pose: Record) -> bool:
        if t > 0.0 and rough.rng.random() < share:
            pose["position_w"] += rough.rng.normal(0.0, 1.0, 3)
        return True

    return spoil


# ---------------------------------------------------------------------- noise
@pytest.mark.parametrize("bearings", [False, True])
def test_noise_as_stated_is_taken_exactly_as_stated(
    laboratory: Any, seed: int, bearings: bool
) -> None:
    rough = Rough(laboratory, seed, imu=0.8).fly(bearings=bearings)
    np.testing.assert_array_equal(rough.scale, 1.0)


@pytest.mark.parametrize("vibration", [0.2, 0.8])
def test_vibration_costs_neither_poses_nor_accuracy(
    laboratory: Any, seed: int, vibration: float
) -> None:
    rough = Rough(laboratory, seed, vibration=vibration).fly()
    assert rough.refused == 0.0
    assert rough.rms(1.0) < 0.0015


@pytest.mark.parametrize(("times", "most"), [(10.0, 0.0025), (30.0, 0.003)])
def test_an_imu_much_noisier_than_stated_is_found_out(
    laboratory: Any, seed: int, times: float, most: float
) -> None:
    rough = Rough(laboratory, seed, imu=times).fly()
    assert rough.refused < 0.02
    assert rough.rms(2.0) < most
    assert rough.scale[FORCE] > 2.0
    assert rough.scale[POSITION] < 2.0
    assert rough.estimator.converged, rough.estimator.convergence.reason


def test_an_imu_much_noisier_than_stated_is_found_out_by_bearings(
    laboratory: Any, seed: int
) -> None:
    rough = Rough(laboratory, seed, imu=30.0).fly(bearings=True)
    assert rough.rms(3.0) < 0.2
    assert 2.0 < rough.scale[FORCE] < 5.0  # bearings alone may be off, too


def test_poses_much_noisier_than_stated_are_found_out(laboratory: Any, seed: int) -> None:
    rough = Rough(laboratory, seed, pose=10.0).fly()
    assert rough.refused < 0.2  # before it has adapted
    assert rough.rms(3.0) < 0.01
    for kind in (POSITION, ATTITUDE):
        assert 30.0 < rough.scale[kind] < 150.0
    for kind in (FORCE, RATE):
        assert rough.scale[kind] < 2.0


def test_factors_fall_again_with_the_noise(laboratory: Any, seed: int) -> None:
    rough = Rough(laboratory, seed, seconds=16.0, imu=30.0)
    quiet = Rough(laboratory, seed, seconds=16.0)
    rough.force[4000:], rough.rate[4000:] = quiet.force[4000:], quiet.rate[4000:]
    rough.fly()
    assert rough.scale.max() < 3.0
    assert rough.rms(15.0) < 0.0015


# ---------------------------------------------------------------------- outliers
def test_a_fifth_of_the_poses_being_wrong_costs_little(laboratory: Any, seed: int) -> None:
    rough = Rough(laboratory, seed, vibration=0.5, imu=5.0)
    rough.fly(outliers(rough, 0.2))
    assert not rough.estimator.restarts
    assert 0.15 < rough.refused < 0.25
    assert rough.rms(1.0) < 0.003


def test_poses_that_contradict_each_other_are_no_start(laboratory: Any, seed: int) -> None:
    rough = Rough(laboratory, seed, seconds=4.0)
    wrong = outliers(rough, 1.0)
    rough.fly(lambda t, pose: wrong(t, pose) if 2.0 < t < 3.2 else True)
    assert not rough.estimator.restarts
    assert rough.rms(2.0) < 0.02


def test_a_tracker_that_is_elsewhere_for_a_moment_is_not_followed(
    laboratory: Any, seed: int
) -> None:
    rough = Rough(laboratory, seed, seconds=4.0, imu=5.0)

    def elsewhere(t: float, pose: Record) -> bool:
        pose["position_w"][0, 0] += 0.3 * (2.0 < t < 2.4)
        return True

    rough.fly(elsewhere)
    assert not rough.estimator.restarts
    assert rough.rms(2.0) < 0.01


# ---------------------------------------------------------------------- recovery
@pytest.mark.parametrize(("far", "turned"), [(1.0, 0.0), (0.0, 60.0), (1.0, 60.0)])
@pytest.mark.parametrize("bearings", [False, True])
def test_a_wrong_start_in_flight_is_left(
    laboratory: Any, seed: int, far: float, turned: float, bearings: bool
) -> None:
    rough = Rough(laboratory, seed, seconds=8.0, imu=3.0)
    axis = np.array([1.0, 1.0, 1.0]) / math.sqrt(3.0)
    attitude = Rotation.from_rotvec(math.radians(turned) * axis) * rough.truth.attitude[0]
    rough.position[0] += far * axis
    rough.quaternion[0] = np.roll(attitude.as_quat(), 1)
    rough.fly(bearings=bearings)
    # Without confirmation, the start waits for the fourth measurement that contradicts it; the
    # velocity follows with the next few.
    assert rough.rms(0.2, 0.5) < (0.25 if bearings else 0.03)
    assert rough.rms(5.0) < (0.08 if bearings else 0.003)
    assert rough.estimator.converged, rough.estimator.convergence.reason


def test_frames_from_elsewhere_for_a_moment_move_no_confirmed_filter(
    laboratory: Any, seed: int
) -> None:
    rough = Rough(laboratory, seed, seconds=4.0, imu=3.0)
    rough.seen_from[1000:1200] = 1.0, 0.0, 0.5  # 0.4 s
    rough.fly(bearings=True)
    assert not rough.estimator.restarts
    assert rough.rms(2.0) < 0.2


def test_a_gap_is_followed_by_a_return_to_the_poses(laboratory: Any, seed: int) -> None:
    rough = Rough(laboratory, seed, seconds=8.0, imu=10.0)
    rough.fly(lambda t, pose: not 3.0 < t < 5.0)
    assert rough.rms(5.3) < 0.003


def test_a_knock_that_the_imu_did_not_measure_is_recovered_from(laboratory: Any, seed: int) -> None:
    """The world continues at another speed than the prediction: drift, and no jump."""
    rough = Rough(laboratory, seed, seconds=6.0)
    t = rough.truth.t
    missed = np.maximum(0.0, t - 3.0)[:, None] * np.array([1.0, 0.5, 0.0])
    rough.position += missed
    rough.truth.position_w += missed
    rough.fly()
    assert rough.rms(4.0) < 0.003


def test_what_is_no_pose_teaches_nothing(laboratory: Any, seed: int) -> None:
    rough = Rough(laboratory, seed, seconds=2.0).fly()
    before = rough.estimator.memory["evidence"].copy()
    pose = np.zeros(1, POSE_SAMPLE)
    pose[0] = 3_002_000_000, [np.nan, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]
    with pytest.raises(MeasurementError):
        rough.estimator.correct(pose, np.zeros(1, ESTIMATE))
    np.testing.assert_array_equal(rough.estimator.memory["evidence"], before)
