"""The error-state filter as a whole: consistency, time, gates, starts, and refusals."""

from __future__ import annotations

import math
import zlib
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from estimation.error_state.estimator import ErrorStateEstimator
from estimation.error_state.filter import apply, predict, take_bearings
from estimation.error_state.memory import new_memory
from estimation.error_state_parameters import ErrorStateParameters
from estimation.estimator import Estimator
from estimation.outcome import Outcome
from estimation.parameters import EstimationParameters, noise_record
from quadrotor.errors import MeasurementError
from quadrotor.records import (
    BEARINGS_SAMPLE,
    ESTIMATE,
    IMU_SAMPLE,
    MAX_BEACONS,
    POSE_SAMPLE,
    STATE,
    Array,
    Record,
    new_state,
)

BEACONS = np.array([[1.0, 1.0, 0.1], [-1.0, 1.0, 0.1], [-1.0, -1.0, 0.1], [1.0, -1.0, 0.1]])
SIGMA = math.radians(1.5)
FORCE, RATE = 0.05, math.radians(0.3)  # noise of one sample at 500 Hz
MS = 1_000_000


def parameters() -> EstimationParameters:
    p = EstimationParameters(measurement_timeout=0.2)
    p.error_state = ErrorStateParameters(
        accelerometer_noise=FORCE / math.sqrt(500.0),
        gyroscope_noise=math.degrees(RATE) / math.sqrt(500.0),
    )
    return p


def frame_of(
    stamp_ns: int,
    position: Array,
    attitude: Rotation,
    rng: np.random.Generator | None = None,
    beacons: Array = BEACONS,
) -> Record:
    frame = np.zeros(1, BEARINGS_SAMPLE)
    away = attitude.inv().apply(beacons - position)
    away /= np.linalg.norm(away, axis=1)[:, None]
    if rng is not None:
        noise = rng.normal(0, SIGMA, away.shape)
        noise -= (noise * away).sum(axis=1)[:, None] * away
        away = np.array(
            [
                Rotation.from_rotvec(np.cross(a, n)).apply(a)
                for a, n in zip(away, noise, strict=True)
            ]
        )
    count = len(beacons)
    frame["stamp_ns"], frame["count"], frame["sigma"] = stamp_ns, count, SIGMA
    frame["beacon_w"][0, :count], frame["bearing_b"][0, :count] = beacons, away
    return frame


def pose_of(stamp_ns: int, position: Any, attitude: Rotation) -> Record:
    pose = np.zeros(1, POSE_SAMPLE)
    pose[0] = stamp_ns, position, np.roll(attitude.as_quat(), 1)
    return pose


class Flight:
    """Estimator along the figure 8 of the laboratory, with noise from one seed."""

    def __init__(self, truth: Any, seed: int, noise: float = 1.0) -> None:
        self.truth, self.noise = truth, noise
        self.rng = np.random.default_rng(seed)
        n = len(truth.t)
        self.force = truth.specific_force_b + noise * self.rng.normal(0, FORCE, (n, 3))
        self.rate = truth.angular_velocity_b + noise * self.rng.normal(0, RATE, (n, 3))
        self.frames = {
            k: frame_of(
                self.stamp(k), truth.position_w[k], truth.attitude[k], self.rng if noise else None
            )
            for k in range(17, n, 17)
        }

    def stamp(self, k: int) -> int:
        return 1_000_000_000 + k * 2 * MS

    def fly(
        self, estimator: Estimator, delay: int = 0, poses: int = 0, start: bool = True
    ) -> Record:
        """Fly with bearings delayed by `delay` ticks.

        An exact pose comes first, and then every `poses` ticks.
        """
        truth, imu, state = self.truth, np.zeros(1, IMU_SAMPLE), new_state()
        estimate, states = np.zeros(1, ESTIMATE), np.zeros(len(truth.t), STATE)
        for k in range(len(truth.t)):
            imu[0] = self.stamp(k), self.force[k], self.rate[k]
            estimator.predict(imu, 0.002, state)
            states[k] = state[0]
            if k == 0 and start:
                estimator.correct(
                    pose_of(self.stamp(0), truth.position_w[0], truth.attitude[0]), estimate
                )
            if poses and k and k % poses == 0:
                pose = pose_of(self.stamp(k), truth.position_w[k], truth.attitude[k])
                estimator.correct(pose, estimate)
            if k - delay in self.frames:
                estimator.correct_bearings(self.frames[k - delay], estimate)
        return states


def errors(truth: Any, states: Record, k: slice = slice(None)) -> Array:
    """Return (n, 9): position, attitude (world axes), velocity, true - estimated."""
    estimated = Rotation.from_quat(np.roll(states["quaternion_wb"][k], -1, axis=1))
    turn = (truth.attitude[k] * estimated.inv()).as_rotvec()
    return np.hstack(
        [
            truth.position_w[k] - states["position_w"][k],
            turn,
            truth.velocity_w[k] - states["velocity_w"][k],
        ]
    )


def error_at(truth: Any, k: int, state: Record) -> Array:
    """Return the errors (9,) of one STATE (1,) at sample k."""
    one = SimpleNamespace(
        **{
            name: getattr(truth, name)[k : k + 1]
            for name in ("position_w", "velocity_w", "attitude")
        }
    )
    row: Array = errors(one, state)[0]
    return row


@pytest.fixture
def seed(request: pytest.FixtureRequest) -> int:
    found = zlib.crc32(request.node.name.encode())
    print(f"seed {found}")
    return found


def test_is_an_estimator() -> None:
    estimator: Estimator = ErrorStateEstimator()
    assert not estimator.initialized
    assert not estimator.converged
    assert math.isinf(estimator.measurement_age)


# ---------------------------------------------------------------------- accuracy, consistency
def test_exact_sensors_give_the_exact_state(laboratory: Any) -> None:
    flight = Flight(laboratory.figure_eight(10.0, 500.0), 0, noise=0.0)
    error = errors(flight.truth, flight.fly(ErrorStateEstimator(parameters()), poses=5))
    assert np.abs(error[-1000:]).max() < 1e-4


def test_errors_and_innovations_are_as_large_as_the_filter_says(laboratory: Any, seed: int) -> None:
    """NEES of 9 states at 8 distant times, NIS of all frames, over 12 flights."""
    from scipy.stats import chi2

    truth = laboratory.figure_eight(10.0, 500.0)
    nees, nis, freedom = [], 0.0, 0
    p = parameters()  # biases are constant here
    p.error_state.accelerometer_bias_walk = p.error_state.gyroscope_bias_walk = 0.0
    for run in range(12):
        estimator = ErrorStateEstimator(p)
        flight = Flight(truth, seed + run)
        memory, estimate = estimator.memory, np.zeros(1, ESTIMATE)
        imu, state = np.zeros(1, IMU_SAMPLE), new_state()
        for k in range(len(truth.t)):
            imu[0] = flight.stamp(k), flight.force[k], flight.rate[k]
            estimator.predict(imu, 0.002, state)
            if k == 0:
                start = np.random.default_rng(seed + 1000 + run).normal(0, 1, 15)
                start *= np.repeat([0.05, 0.03, 0.5, 0.0, 0.0], 3)
                pose = pose_of(
                    flight.stamp(0),
                    truth.position_w[0] + start[:3],
                    Rotation.from_rotvec(start[3:6]) * truth.attitude[0],
                )
                estimator.correct(pose, estimate)
                memory["base"][0, 3:6] = truth.velocity_w[0] + start[6:9]
                memory["after_state"][0, 0] = memory["now"][0] = memory["base"][0]
                diagonal = np.repeat([0.05, 0.03, 0.5, 1e-4, 1e-4], 3) ** 2
                memory["covariance"][0] = memory["after_covariance"][0, 0] = np.diag(diagonal)
            if k in flight.frames:
                estimator.correct_bearings(flight.frames[k], estimate)
                nis += float(memory["nis"][0])
                freedom += int(memory["freedom"][0])
                if k == max(flight.frames):
                    now = np.zeros(1, STATE)
                    x = memory["now"][0]
                    now["position_w"], now["velocity_w"] = x[:3], x[3:6]
                    now["quaternion_wb"] = memory["now"][0, 6:10]
                    e = error_at(truth, k, now)
                    nees.append(float(e @ np.linalg.solve(estimator.covariance[:9, :9], e)))
    low, high = chi2.ppf([0.005, 0.995], 9 * len(nees))
    print("NEES", sum(nees), low, high, "NIS", nis / freedom)
    assert low < sum(nees) < high
    low, high = chi2.ppf([0.005, 0.995], freedom)
    assert low < nis < high


def test_covariance_stays_symmetric_and_positive(laboratory: Any, seed: int) -> None:
    """A start of metres and a tracker of 0.1 mm are 10 orders of variance apart."""
    p = parameters()
    p.error_state.pose_position_sigma = 1e-4
    p.error_state.pose_attitude_sigma = 0.01
    estimator = ErrorStateEstimator(p)
    flight = Flight(laboratory.figure_eight(6.0, 500.0), seed)
    flight.fly(estimator, delay=10, poses=5)
    for P in (estimator.covariance, *estimator.memory["after_covariance"][0]):
        np.testing.assert_array_equal(np.isfinite(P), True)
        np.testing.assert_allclose(P, P.T, atol=1e-15)
        scale = np.sqrt(np.diag(P))
        assert np.linalg.eigvalsh(P / np.outer(scale, scale)).min() > 0.0


def test_a_wrong_start_is_forgotten(laboratory: Any, seed: int) -> None:
    truth = laboratory.figure_eight(6.0, 500.0)
    flight = Flight(truth, seed)
    estimator = ErrorStateEstimator(parameters())
    wrong = Rotation.from_rotvec([0.05, -0.05, 0.06]) * truth.attitude[0]
    estimator.initialize(pose_of(flight.stamp(0), truth.position_w[0] + [0.1, -0.1, 0.1], wrong))
    error = np.abs(errors(truth, flight.fly(estimator, start=False)))
    assert error[10, :3].max() > 0.05
    assert np.sqrt((error[-1000:, :3] ** 2).sum(axis=1).mean()) < 0.04
    assert estimator.converged, estimator.convergence.reason


@pytest.mark.parametrize("way", range(6))
def test_a_start_far_off_is_given_up_even_where_some_bearings_fit(
    laboratory: Any, way: int
) -> None:
    truth = laboratory.figure_eight(3.0, 500.0)
    flight = Flight(truth, 1)
    away, axis = np.random.default_rng(way).normal(size=(2, 3))
    turn = Rotation.from_rotvec(math.radians(60.0) * axis / np.linalg.norm(axis))
    place = truth.position_w[0] + away / np.linalg.norm(away)
    estimator = ErrorStateEstimator(parameters())
    estimator.initialize(pose_of(flight.stamp(0), place, turn * truth.attitude[0]))
    error = np.abs(errors(truth, flight.fly(estimator, start=False)))
    assert error[-100:, :3].max() < 0.15  # one or two of four fit by chance: up to 40 m


def test_turning_the_world_turns_the_answer(laboratory: Any, seed: int) -> None:
    angle = 2.1
    world = Rotation.from_euler("z", angle)
    plain = Flight(laboratory.figure_eight(3.0, 500.0), seed)
    turned = Flight(laboratory.figure_eight(3.0, 500.0, turned=angle), seed)
    turned.frames = {k: f.copy() for k, f in plain.frames.items()}
    for frame in turned.frames.values():
        frame["beacon_w"][0, :4] = world.apply(BEACONS)
    one, other = ErrorStateEstimator(parameters()), ErrorStateEstimator(parameters())
    a, b = plain.fly(one), turned.fly(other)
    # The first sample is before the first pose, when nothing is known of the world.
    np.testing.assert_allclose(b["position_w"][1:], world.apply(a["position_w"][1:]), atol=1e-6)
    np.testing.assert_allclose(b["velocity_w"][1:], world.apply(a["velocity_w"][1:]), atol=1e-6)
    assert one.memory["nis"][0] == pytest.approx(other.memory["nis"][0], rel=1e-4)


# ---------------------------------------------------------------------- time
@pytest.mark.parametrize("delay", [1, 10, 16, 40])
def test_late_bearings_end_where_those_in_time_would_have(
    laboratory: Any, seed: int, delay: int
) -> None:
    """The states are equal; with tracker poses in between, they arrive out of order."""
    truth = laboratory.figure_eight(3.0, 500.0)
    prompt, late = ErrorStateEstimator(parameters()), ErrorStateEstimator(parameters())
    flight = Flight(truth, seed)
    for k in [k for k in flight.frames if k > len(truth.t) - 60]:
        del flight.frames[k]
    flight.fly(prompt, poses=20)
    flight.fly(late, poses=20, delay=delay)
    assert not late.ignored
    for name in ("now", "covariance"):
        np.testing.assert_allclose(late.memory[name], prompt.memory[name], rtol=1e-6, atol=1e-9)


def test_a_frame_between_two_samples_meets_its_own_instant() -> None:
    """A millisecond is 2 mm at 2 m/s; the beacons are seen from the exact true position."""
    estimator, state, estimate = ErrorStateEstimator(), new_state(), np.zeros(1, ESTIMATE)
    estimator.initialize(pose_of(2 * MS, [0.0, 0.0, 1.0], Rotation.identity()))
    imu = np.zeros(1, IMU_SAMPLE)
    for k in range(1, 301):
        imu[0] = 2 * MS * k, [4.0, 0.0, 9.81], [0.0, 0.0, 0.0]
        estimator.predict(imu, 0.002, state)
    t = 0.5531 - 0.002
    where = np.array([0.5 * 4.0 * t * t, 0.0, 1.0])
    estimator.correct_bearings(frame_of(round(0.5531e9), where, Rotation.identity()), estimate)
    estimator.report(estimate)
    assert np.abs(estimate["position_innovation_w"]).max() < 1e-6
    assert float(estimator.memory["nis"][0]) < 1e-6


def test_a_measurement_ahead_of_the_samples_waits_for_them() -> None:
    estimator, estimate = ErrorStateEstimator(), np.zeros(1, ESTIMATE)
    imu, state = np.zeros(1, IMU_SAMPLE), new_state()
    level = Rotation.identity()
    estimator.correct(pose_of(2 * MS, [0.0, 0.0, 1.0], level), estimate)
    for k in range(1, 51):
        imu[0] = 2 * MS * k, [0.0, 0.0, 9.81], [0.0, 0.0, 0.0]
        estimator.predict(imu, 0.002, state)
        if k == 20:
            estimator.correct_bearings(frame_of(50 * MS, [0.0, 0.0, 1.0], level), estimate)  # type: ignore[arg-type]
            assert estimator.memory["applied"][0] == 0
        assert estimator.memory["applied"][0] == (1 if k >= 25 else 0)
    estimator.correct_bearings(frame_of(200 * MS, [0.0, 0.0, 1.0], level), estimate)  # type: ignore[arg-type]
    assert estimator.ignored == {Outcome.AHEAD: 1}


def test_measurements_outside_the_known_time_are_counted_and_change_nothing(
    laboratory: Any, seed: int
) -> None:
    flight = Flight(laboratory.figure_eight(2.0, 500.0), seed)
    estimator, estimate = ErrorStateEstimator(parameters()), np.zeros(1, ESTIMATE)
    flight.fly(estimator, poses=5)
    before = estimator.memory["now"].copy(), estimator.covariance
    newest = pose_of(flight.stamp(1000), [9.0, 9.0, 9.0], Rotation.identity())
    estimator.correct(newest, estimate)  # the last stamp again
    ancient = pose_of(flight.stamp(100), [9.0, 9.0, 9.0], Rotation.identity())
    estimator.correct(ancient, estimate)
    assert estimator.ignored == {Outcome.NOT_NEWER: 1, Outcome.TOO_OLD: 1}
    np.testing.assert_array_equal(estimator.memory["now"], before[0])
    np.testing.assert_array_equal(estimator.covariance, before[1])


def test_without_measurements_the_covariance_grows_and_the_estimate_goes_on(
    laboratory: Any, seed: int
) -> None:
    truth = laboratory.figure_eight(8.0, 500.0)
    flight = Flight(truth, seed)
    flight.frames = {k: f for k, f in flight.frames.items() if k < 2500}
    estimator = ErrorStateEstimator(parameters())
    error = errors(truth, flight.fly(estimator))
    assert estimator.stale
    assert not estimator.converged
    assert "ago" in estimator.convergence.reason
    deviations = estimator.deviations
    assert 0.05 < deviations.position < 1.0
    assert np.linalg.norm(error[-1, :3]) < 4.0 * deviations.position


# ---------------------------------------------------------------------- gates
def converged(laboratory: Any, seed: int) -> tuple[ErrorStateEstimator, Flight]:
    flight = Flight(laboratory.figure_eight(4.0, 500.0), seed)
    estimator = ErrorStateEstimator(parameters())
    del flight.frames[max(flight.frames)]
    flight.fly(estimator)
    return estimator, flight


@pytest.mark.parametrize("swapped", [(0, 1), (0, 2), (1, 3)])
def test_two_swapped_beacons_are_left_out_and_the_others_used(
    laboratory: Any, seed: int, swapped: tuple[int, int]
) -> None:
    estimator, flight = converged(laboratory, seed)
    k = 2000
    truth, one = flight.truth, list(swapped)
    frame = frame_of(flight.stamp(k), truth.position_w[k], truth.attitude[k])
    frame["beacon_w"][0, one] = frame["beacon_w"][0, one[::-1]]
    before = estimator.memory["now"][0, :3].copy()
    estimator.correct_bearings(frame, np.zeros(1, ESTIMATE))
    assert [bool(u) for u in estimator.memory["used"][0, :4]] == [i not in one for i in range(4)]
    assert np.linalg.norm(estimator.memory["now"][0, :3] - before) < 0.03


def test_an_outlier_changes_nothing_and_many_mean_that_the_filter_is_lost(
    laboratory: Any, seed: int
) -> None:
    estimator, flight = converged(laboratory, seed)
    there, estimate = [3.0, 3.0, 2.0], np.zeros(1, ESTIMATE)
    before = estimator.memory["now"].copy()
    estimator.correct(pose_of(flight.stamp(2000), there, Rotation.identity()), estimate)
    np.testing.assert_allclose(estimator.memory["now"], before, atol=1e-12)
    assert estimator.ignored == {Outcome.OUTLIER: 1}
    imu, state = np.zeros(1, IMU_SAMPLE), new_state()
    for k in range(2001, 2600):
        imu[0] = flight.stamp(k), [0.0, 0.0, 9.81], [0.0, 0.0, 0.0]
        estimator.predict(imu, 0.002, state)
        if k % 20 == 0:
            estimator.correct(pose_of(flight.stamp(k), there, Rotation.identity()), estimate)
    np.testing.assert_allclose(state["position_w"][0], there, atol=0.02)


# ---------------------------------------------------------------------- starts, bad input
def test_bearings_alone_give_a_start() -> None:
    estimator, where = ErrorStateEstimator(), np.array([0.3, -0.2, 1.2])
    attitude = Rotation.from_euler("ZYX", [2.0, 0.1, -0.1])
    estimator.correct_bearings(frame_of(2 * MS, where, attitude), np.zeros(1, ESTIMATE))
    assert estimator.initialized
    np.testing.assert_allclose(estimator.memory["now"][0, :3], where, atol=1e-6)
    assert estimator.deviations.position > 0.1


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("count", 0),
        ("count", MAX_BEACONS + 1),
        ("count", -1),
        ("sigma", 0.0),
        ("sigma", np.nan),
        ("sigma", np.inf),
        ("bearing_b", np.nan),
        ("bearing_b", 0.0),
        ("bearing_b", 2.0),
        ("beacon_w", np.nan),
        ("beacon_w", np.inf),
    ],
)
def test_a_frame_that_is_none_is_refused_and_changes_nothing(field: str, value: Any) -> None:
    for started in (False, True):
        estimator, estimate = ErrorStateEstimator(), np.zeros(1, ESTIMATE)
        if started:
            estimator.initialize(pose_of(2 * MS, [0.0, 0.0, 1.0], Rotation.identity()))
        frame = frame_of(2 * MS, np.array([0.0, 0.0, 1.0]), Rotation.identity())
        frame[field] = value
        before = estimator.memory["now"].copy(), estimator.covariance
        with pytest.raises(MeasurementError, match="bearings"):
            estimator.correct_bearings(frame, estimate)
        np.testing.assert_array_equal(estimator.memory["now"], before[0])
        np.testing.assert_array_equal(estimator.covariance, before[1])


@pytest.mark.parametrize("quaternion", [(np.nan, 0, 0, 0), (0.5, 0, 0, 0), (1, 1, 0, 0)])
def test_a_pose_that_is_none_is_refused(quaternion: tuple[float, ...]) -> None:
    estimator = ErrorStateEstimator()
    pose = pose_of(2 * MS, [0.0, 0.0, 1.0], Rotation.identity())
    good = pose.copy()
    pose["quaternion_wb"] = quaternion
    for _ in range(2):
        with pytest.raises(MeasurementError, match="pose"):
            estimator.correct(pose, np.zeros(1, ESTIMATE))
        estimator.initialize(good)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(*[st.floats(-3, 3)] * 3), min_size=1, max_size=MAX_BEACONS),
    st.tuples(*[st.floats(-2, 2)] * 3),
    st.floats(1e-6, 1.0),
)
def test_any_beacons_anywhere_leave_a_finite_positive_filter(
    places: list[tuple[float, float, float]], where: tuple[float, float, float], sigma: float
) -> None:
    """The beacons are on the vehicle itself, all at one point, in any number."""
    estimator = ErrorStateEstimator()
    estimator.initialize(pose_of(2 * MS, [0.0, 0.0, 1.0], Rotation.identity()))
    frame = np.zeros(1, BEARINGS_SAMPLE)
    away = np.array(places) - where
    length = np.linalg.norm(away, axis=1)[:, None]
    away = np.where(length > 1e-9, away / np.maximum(length, 1e-12), [0.0, 0.0, -1.0])
    frame["stamp_ns"], frame["count"], frame["sigma"] = 2 * MS, len(places), sigma
    frame["beacon_w"][0, : len(places)], frame["bearing_b"][0, : len(places)] = places, away
    imu, state = np.zeros(1, IMU_SAMPLE), new_state()
    for k in range(1, 4):
        imu[0] = 2 * MS * k, [0.0, 0.0, 9.81], [0.0, 0.0, 0.0]
        estimator.predict(imu, 0.002, state)
        frame["stamp_ns"] = 2 * MS * k
        estimator.correct_bearings(frame, np.zeros(1, ESTIMATE))
    P = estimator.covariance
    assert np.isfinite(P).all()
    assert np.isfinite(estimator.memory["now"]).all()
    scale = np.sqrt(np.diag(P))
    assert np.linalg.eigvalsh(P / np.outer(scale, scale)).min() > -1e-9


def test_biases_are_learnt_and_stay_within_their_limits(laboratory: Any, seed: int) -> None:
    flight = Flight(laboratory.figure_eight(12.0, 500.0), seed)
    flight.rate += [0.01, -0.01, 0.008]
    flight.force += [0.05, -0.05, 0.3]
    p = parameters()
    estimator, estimate = ErrorStateEstimator(p), np.zeros(1, ESTIMATE)
    flight.fly(estimator, poses=5)
    estimator.report(estimate)
    np.testing.assert_allclose(estimate["gyroscope_bias_b"][0], [0.01, -0.01, 0.008], atol=1e-3)
    np.testing.assert_allclose(estimate["accelerometer_bias_b"][0], [0.05, -0.05, 0.3], atol=0.03)
    for name, limit, largest in (
        ("accelerometer_bias_limit", 0.1, "accelerometer_bias_b"),
        ("gyroscope_bias_limit", 0.005, "gyroscope_bias_b"),
    ):
        estimator = ErrorStateEstimator(parameters().model_copy(update={name: limit}))
        flight.fly(estimator, poses=5)
        estimator.report(estimate)
        assert np.abs(estimate[largest]).max() == limit


def test_a_batch_equals_its_single_flights(rng: np.random.Generator) -> None:
    count, noise = 3, noise_record(EstimationParameters())
    imu, frames = np.zeros(count, IMU_SAMPLE), np.zeros(count, BEARINGS_SAMPLE)
    batch, states = new_memory(count), np.zeros(count, STATE)
    outcomes = np.zeros(count, np.int64)
    one = ErrorStateEstimator()
    one.initialize(pose_of(0, [0.0, 0.0, 1.0], Rotation.identity()))
    batch[:] = one.memory[0]
    singles = [batch[k : k + 1].copy() for k in range(count)]
    state = np.zeros(1, STATE)
    for i in range(1, 40):
        imu["stamp_ns"] = i * 2 * MS
        imu["specific_force_b"] = rng.normal(size=(count, 3)) + np.array([0.0, 0.0, 9.81])
        imu["angular_velocity_b"] = 0.1 * rng.normal(size=(count, 3))
        predict(batch, imu, noise, 0.002, states)
        if i % 10 == 0:
            for k in range(count):
                where = np.array([0.0, 0.0, 1.0]) + 0.01 * rng.normal(size=3)
                frames[k] = frame_of(i * 2 * MS - 3 * MS, where, Rotation.identity(), rng)[0]
                assert take_bearings(batch[k], frames[k])
            apply(batch, noise, outcomes)
            assert not outcomes.any()
        for k, single in enumerate(singles):
            predict(single, imu[k : k + 1], noise, 0.002, state)
            assert state[0] == states[k]
            if i % 10 == 0:
                assert take_bearings(single[0], frames[k])
                apply(single, noise, outcomes[:1])
    for k, single in enumerate(singles):
        np.testing.assert_array_equal(single["now"][0], batch["now"][k])
        np.testing.assert_array_equal(single["covariance"][0], batch["covariance"][k])
