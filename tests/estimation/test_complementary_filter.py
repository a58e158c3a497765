"""The filter as a whole: bias, rates, signs, time, and operation without a pose."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimation.complementary import ComplementaryEstimator, correct, predict, report
from estimation.estimator import Estimator
from estimation.memory import HISTORY_LENGTH, new_memory
from estimation.outcome import AHEAD_NS, Agreement, Outcome
from estimation.parameters import PRESETS, EstimationParameters, estimation_record
from quadrotor.errors import MeasurementError
from quadrotor.records import ESTIMATE, IMU_SAMPLE, POSE_SAMPLE, STATE, Record, new_state
from tests.support.narrowing import now

PERIOD_NS = 2_000_000
PAPER = EstimationParameters.model_validate(PRESETS["paper"])
# The fastest allowed biases: a start from rest into motion is forgotten within seconds.
BRISK = EstimationParameters(accelerometer_bias_bandwidth=2.0, gyroscope_bias_bandwidth=1.0)


def pose_at(stamp_ns: int, position: Any = (0.0, 0.0, 0.0), yaw: float = 0.0) -> Record:
    pose = np.zeros(1, POSE_SAMPLE)
    pose["stamp_ns"], pose["position_w"] = stamp_ns, position
    pose["quaternion_wb"] = (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))
    return pose


def imu_at(stamp_ns: int, force: Any = (0.0, 0.0, 9.81), rate: Any = (0.0, 0.0, 0.0)) -> Record:
    imu = np.zeros(1, IMU_SAMPLE)
    imu["stamp_ns"], imu["specific_force_b"], imu["angular_velocity_b"] = stamp_ns, force, rate
    return imu


class Still:
    """Estimator of a vehicle at rest, ticked by hand."""

    def __init__(self, parameters: EstimationParameters | None = None) -> None:
        self.estimator = ComplementaryEstimator(parameters)
        self.state = new_state()
        self.estimate = np.zeros(1, ESTIMATE)
        self.stamp_ns = 0

    def tick(self, count: int = 1, **imu: Any) -> None:
        for _ in range(count):
            self.stamp_ns += PERIOD_NS
            self.estimator.predict(imu_at(self.stamp_ns, **imu), PERIOD_NS * 1e-9, self.state)

    def correct(self, ago_ns: int = 0, **pose: Any) -> None:
        self.estimator.correct(pose_at(self.stamp_ns - ago_ns, **pose), self.estimate)

    def unchanged_since(self, before: Record) -> bool:
        """Return whether all except the counts of measurements equals this copy of the memory."""
        now = self.estimator.memory.copy()
        now["outcomes"] = before["outcomes"]
        return bool(now == before)


def test_is_an_estimator() -> None:
    estimator: Estimator = ComplementaryEstimator()
    assert not estimator.initialized


# ---------------------------------------------------------------------- accuracy
def test_exact_sensors_give_the_exact_state(laboratory: Any) -> None:
    flown = laboratory.fly(laboratory.figure_eight(20.0, 500.0), laboratory.Sensors(), BRISK)
    assert flown.rms("position", 16.0) < 1e-6
    assert flown.rms("velocity", 16.0) < 1e-5
    assert flown.rms("attitude", 16.0) < 1e-6


def test_full_sensors_noise_of_the_defaults_and_of_the_papers_gains(laboratory: Any) -> None:
    truth = laboratory.figure_eight(32.0, 500.0)
    ours = laboratory.fly(truth, laboratory.full)
    paper = laboratory.fly(truth, laboratory.full, PAPER)
    assert ours.rms("position", 16.0) < 0.9e-3
    assert ours.rms("velocity", 16.0) < 5e-3
    assert ours.rms("attitude", 16.0) < math.radians(0.08)
    assert paper.rms("velocity", 16.0) > 5.0 * ours.rms("velocity", 16.0)
    assert paper.rms("attitude", 16.0) > 2.0 * ours.rms("attitude", 16.0)


def test_turning_the_world_turns_the_answer(laboratory: Any) -> None:
    sensors = dataclasses.replace(
        laboratory.Sensors(), force_bias=(0.2, -0.1, 0.1), rate_bias=(0.01, 0.02, -0.01)
    )
    plain = laboratory.fly(laboratory.figure_eight(4.0, 500.0), sensors)
    angle = 2.1
    turned = laboratory.fly(laboratory.figure_eight(4.0, 500.0, turned=angle), sensors)
    world = Rotation.from_euler("z", angle)
    for name in ("position", "velocity"):
        wanted = world.apply(getattr(plain, name))
        # The first sample is before the first pose, when nothing is known of the world.
        np.testing.assert_allclose(getattr(turned, name)[1:], wanted[1:], atol=1e-9)
    np.testing.assert_allclose(turned.attitude[1:], plain.attitude[1:], atol=1e-9)
    np.testing.assert_allclose(turned.force_bias, plain.force_bias, atol=1e-8)


# ---------------------------------------------------------------------- biases
@pytest.mark.parametrize("yaw", [0.0, 90.0, 180.0, 270.0])
def test_biases_converge_at_any_yaw(laboratory: Any, yaw: float) -> None:
    """A gain that does not turn with the yaw makes the accelerometer's diverge at 180 degrees."""
    truth = laboratory.figure_eight(40.0, 250.0, scale=0.0, turned=math.radians(yaw))
    force_bias, rate_bias = (0.3, -0.2, 0.1), (0.02, -0.01, 0.015)
    sensors = laboratory.Sensors(pose_every=3, force_bias=force_bias, rate_bias=rate_bias)
    flown = laboratory.fly(truth, sensors)
    np.testing.assert_allclose(flown.force_bias[-1], force_bias, atol=1e-3)
    np.testing.assert_allclose(flown.rate_bias[-1], rate_bias, atol=1e-4)
    assert np.linalg.norm(flown.position[-1]) < 1e-4
    assert np.linalg.norm(flown.velocity[-1]) < 1e-3


def test_biases_converge_while_tilting_and_turning(laboratory: Any) -> None:
    force_bias, rate_bias = (0.3, -0.2, 0.1), (0.02, -0.01, 0.015)
    sensors = laboratory.Sensors(force_bias=force_bias, rate_bias=rate_bias)
    flown = laboratory.fly(laboratory.figure_eight(40.0, 500.0, period=4.0), sensors)
    np.testing.assert_allclose(flown.force_bias[-1], force_bias, atol=3e-3)
    np.testing.assert_allclose(flown.rate_bias[-1], rate_bias, atol=3e-4)


def test_biases_stay_within_their_limits() -> None:
    still = Still(
        EstimationParameters(
            accelerometer_bias_limit=0.1,
            gyroscope_bias_limit=0.01,
            accelerometer_bias_bandwidth=2.0,
            gyroscope_bias_bandwidth=1.0,
        )
    )
    still.correct()
    for _ in range(300):
        still.tick(5, force=(3.0, 0.0, 9.81), rate=(0.0, 0.0, 1.0))
        still.correct()
    still.estimator.report(still.estimate)
    assert still.estimate["accelerometer_bias_b"][0, 0] == 0.1
    assert still.estimate["gyroscope_bias_b"][0, 2] == 0.01


def test_zero_bandwidth_holds_the_biases(laboratory: Any) -> None:
    flown = laboratory.fly(laboratory.figure_eight(2.0, 500.0), laboratory.full, PAPER)
    assert not flown.force_bias.any()
    assert not flown.rate_bias.any()


# ---------------------------------------------------------------------- rates, signs
@pytest.mark.parametrize("every", [5, 7, 8, 17, 25, 50])
@pytest.mark.parametrize("preset", ["default", "paper", "bearings"])
def test_stable_from_10_to_100_hz(every: int, preset: str) -> None:
    """500 Hz over `every`; a held innovation or a gain times the period diverges below 76 Hz."""
    still = Still(EstimationParameters.model_validate(PRESETS.get(preset, {})))
    still.correct()
    errors = []
    for _ in range(15_000 // every):
        still.tick(every)
        still.correct(position=(0.3, -0.2, 0.1), yaw=0.5)
        errors.append(float(np.abs(still.state["position_w"][0] - [0.3, -0.2, 0.1]).max()))
    assert max(errors) < 0.7
    assert errors[-1] < 2e-3
    assert np.abs(still.state["velocity_w"]).max() < 2e-3
    assert still.state["quaternion_wb"][0, 3] == pytest.approx(math.sin(0.25), abs=8e-3)


def test_irregular_intervals_do_not_disturb_an_exact_estimate(
    laboratory: Any, rng: np.random.Generator
) -> None:
    still = Still(PAPER)
    still.correct()
    for _ in range(300):
        still.tick(int(rng.integers(1, 60)))
        still.correct(position=(1.0, 0.0, 0.0))
    assert still.state["position_w"][0, 0] == pytest.approx(1.0, abs=1e-9)


def test_sign_of_the_measured_quaternion_does_not_matter(laboratory: Any) -> None:
    truth = laboratory.figure_eight(6.0, 500.0)
    plus = laboratory.fly(truth, laboratory.full)
    minus = laboratory.fly(truth, dataclasses.replace(laboratory.full, sign=-1.0))
    for name in ("position", "velocity", "attitude", "rate", "force_bias", "rate_bias"):
        np.testing.assert_allclose(getattr(plus, name), getattr(minus, name), atol=1e-12)


def test_quaternion_stays_unit(laboratory: Any) -> None:
    flown = laboratory.fly(laboratory.figure_eight(4.0, 500.0), laboratory.full)
    lengths = np.linalg.norm(flown.states["quaternion_wb"], axis=1)
    np.testing.assert_allclose(lengths, 1.0, atol=1e-12)


# ---------------------------------------------------------------------- late measurements
@pytest.mark.parametrize("delay", [0, 1, 10, 50, 120])
def test_a_known_delay_costs_nothing_with_exact_sensors(laboratory: Any, delay: int) -> None:
    flown = laboratory.fly(
        laboratory.figure_eight(20.0, 500.0), laboratory.Sensors(delay=delay, pose_every=4), BRISK
    )
    assert flown.rms("position", 16.0) < 1e-5
    assert flown.rms("attitude", 16.0) < 1e-5


def test_many_measurements_on_their_way_do_not_make_it_swing(laboratory: Any) -> None:
    """Delay 0.2 s at a pole of 63 rad/s: twelve times what a held correction survives."""
    flown = laboratory.fly(
        laboratory.figure_eight(6.0, 500.0), laboratory.Sensors(delay=100), PAPER
    )
    assert np.abs(flown.position[1000:]).max() < 0.01


def test_a_late_correction_ends_where_one_in_time_would_have(rng: np.random.Generator) -> None:
    """Exact while the attitude is constant: position, velocity, bias, with several in transit."""
    prompt, late = Still(BRISK), Still(BRISK)
    for still in (prompt, late):
        still.correct()
    offset = 0.02 * rng.normal(size=(30, 3))  # small enough to stay within the bias limit
    for i in range(1, 40):
        for still, delay in ((prompt, 0), (late, 3)):
            still.tick(25)
            if 1 <= i - delay <= len(offset):
                seen = offset[i - delay - 1]
                still.correct(ago_ns=delay * 25 * PERIOD_NS, position=seen)
    assert not late.estimator.ignored
    for name in ("pose", "velocity_w", "accelerometer_bias_b"):
        wanted = prompt.estimator.memory[name]
        assert np.abs(wanted).max() > 1e-3
        np.testing.assert_allclose(late.estimator.memory[name], wanted, atol=1e-9)


def test_a_pose_between_two_samples_meets_the_interpolated_estimate() -> None:
    still = Still()
    still.correct()
    still.tick(200, force=(5.0, 0.0, 9.81))
    t = 0.3991  # s, between two ticks
    still.correct(ago_ns=round((0.4 - t) * 1e9), position=(0.0, 0.0, 0.0))
    # The first sample is assumed to have lasted its whole period.
    assert still.estimate["position_innovation_w"][0, 0] == pytest.approx(-2.5 * t * t, abs=1e-5)


def test_a_pose_a_little_ahead_meets_the_extrapolated_estimate() -> None:
    still = Still()
    still.correct()
    still.tick(500, force=(1.0, 0.0, 9.81), rate=(0.0, 0.0, 0.5))
    v = still.state["velocity_w"][0, 0]
    p = still.state["position_w"][0, 0]
    yaw = 0.5 * 1.0
    still.correct(ago_ns=-10_000_000, position=(p + 0.01 * v, 0.0, 0.0), yaw=yaw + 0.005)
    assert still.estimate["position_innovation_w"][0, 0] == pytest.approx(0.0, abs=1e-12)
    assert still.estimate["attitude_innovation_b"][0, 2] == pytest.approx(0.0, abs=1e-9)


def test_poses_outside_the_known_time_are_counted_and_change_nothing() -> None:
    still = Still()
    still.correct()
    still.tick(HISTORY_LENGTH + 50)
    still.correct()
    before = still.estimator.memory.copy()
    far = (5.0, 5.0, 5.0)
    still.correct(position=far)  # the same stamp again
    still.correct(ago_ns=PERIOD_NS, position=far)  # older than the last applied
    still.correct(ago_ns=-AHEAD_NS - 1, position=far)
    assert still.unchanged_since(before)
    assert still.estimator.ignored == {Outcome.NOT_NEWER: 2, Outcome.AHEAD: 1}
    still.estimator.report(still.estimate)
    counts = ("measurements_used", "measurements_refused", "measurements_ignored", "agreement")
    assert still.estimate[list(counts)][0].tolist() == (2, 0, 3, Agreement.USED)


def test_a_pose_older_than_the_history_is_ignored_and_one_just_inside_is_used() -> None:
    still = Still()
    still.correct()
    still.tick(HISTORY_LENGTH + 50)
    far = (0.2, 0.2, 0.2)
    still.correct(ago_ns=HISTORY_LENGTH * PERIOD_NS, position=far)
    assert still.estimator.ignored == {Outcome.TOO_OLD: 1}
    still.correct(ago_ns=(HISTORY_LENGTH - 1) * PERIOD_NS, position=far)
    assert still.estimator.ignored == {Outcome.TOO_OLD: 1}
    assert still.estimate["position_innovation_w"][0] == pytest.approx(far, abs=1e-12)


def test_history_spans_a_quarter_of_a_second_at_1000_hz() -> None:
    assert (HISTORY_LENGTH - 1) / 1000.0 >= 0.25


# ---------------------------------------------------------------------- without a pose
def test_stale_after_the_timeout_and_only_then() -> None:
    still = Still()
    assert still.estimator.stale
    assert still.estimator.measurement_age == math.inf
    still.tick()
    still.correct()
    still.tick(50)
    assert still.estimator.measurement_age == pytest.approx(0.1)
    assert not now(still).estimator.stale
    still.tick()
    assert now(still).estimator.stale
    still.estimator.report(still.estimate)
    assert still.estimate["measurement_age"][0] == pytest.approx(0.102)
    still.correct()
    assert not still.estimator.stale


def test_a_late_pose_counts_by_when_it_was_true() -> None:
    still = Still()
    still.correct()
    still.tick(100)
    still.correct(ago_ns=150_000_000)
    assert still.estimator.measurement_age == pytest.approx(0.15)
    assert still.estimator.stale


def test_a_lost_pose_is_not_held() -> None:
    """The vehicle moves off at 1 m/s; a held pose would pull the estimate back."""
    still = Still()
    still.correct()
    still.tick(1)
    still.tick(100, force=(5.0, 0.0, 9.81))
    still.tick(100)
    assert still.state["position_w"][0, 0] == pytest.approx(0.1 + 0.2, abs=2e-3)
    assert still.state["velocity_w"][0, 0] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_dead_reckoning_for_five_seconds_needs_the_biases(laboratory: Any, seed: int) -> None:
    truth = laboratory.figure_eight(30.0, 500.0)
    sensors = dataclasses.replace(laboratory.full, pose_until=25.0)
    ours = laboratory.fly(truth, sensors, seed=seed)
    paper = laboratory.fly(truth, sensors, PAPER, seed=seed)
    print("drift after 5 s, m:", np.linalg.norm(ours.position[-1]))
    assert np.linalg.norm(ours.position[-1]) < 0.6
    assert np.linalg.norm(ours.position[-2000]) < 0.03
    assert np.linalg.norm(paper.position[-1]) > 2.0 * np.linalg.norm(ours.position[-1])
    np.testing.assert_array_equal(ours.force_bias[-1], ours.force_bias[-2400])
    np.testing.assert_array_equal(ours.rate_bias[-1], ours.rate_bias[-2400])


def test_a_pose_after_a_long_gap_brings_it_back() -> None:
    still = Still()
    still.correct()
    still.tick(2500, force=(0.05, 0.0, 9.81))  # 5 s
    assert still.state["position_w"][0, 0] > 0.5
    still.correct()
    still.tick()
    assert still.state["position_w"][0, 0] == pytest.approx(0.0, abs=0.01)
    assert abs(still.state["velocity_w"][0, 0]) < 0.25


# ---------------------------------------------------------------------- life cycle, bad input
def test_before_the_first_pose_only_the_rate_is_estimated() -> None:
    still = Still()
    still.tick(100, rate=(0.1, 0.2, 0.3))
    np.testing.assert_allclose(still.state["angular_velocity_b"][0], [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(still.state["position_w"][0], 0.0)
    np.testing.assert_array_equal(still.state["quaternion_wb"][0], [1.0, 0.0, 0.0, 0.0])
    still.correct(position=(1.0, 2.0, 3.0), yaw=1.0)
    assert still.estimator.initialized
    still.tick()
    np.testing.assert_allclose(still.state["position_w"][0], [1.0, 2.0, 3.0], atol=1e-9)


def test_initialize_starts_anew_and_keeps_the_biases() -> None:
    still = Still()
    still.correct()
    for _ in range(500):
        still.tick(5, force=(0.2, 0.0, 9.81))
        still.correct()
    still.estimator.report(still.estimate)
    bias = still.estimate["accelerometer_bias_b"][0, 0]
    assert bias > 0.1
    still.estimator.initialize(pose_at(still.stamp_ns, (7.0, 0.0, 0.0)))
    still.tick(force=(0.2, 0.0, 9.81))
    assert still.state["position_w"][0, 0] == pytest.approx(7.0, abs=1e-4)
    assert abs(still.state["velocity_w"][0, 0]) < 1e-3
    still.estimator.report(still.estimate)
    assert still.estimate["accelerometer_bias_b"][0, 0] == bias
    still.estimator.reset()
    assert not still.estimator.initialized


def test_new_gains_keep_the_state() -> None:
    still = Still()
    still.correct(position=(1.0, 0.0, 0.0))
    still.tick(10)
    before = still.estimator.memory.copy()
    still.estimator.configure(EstimationParameters(position_bandwidth=20.0))
    assert still.estimator.memory == before
    still.correct(position=(2.0, 0.0, 0.0))
    assert still.estimator.memory["pose"][0, 0] > 1.3


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("position_w", (np.nan, 0.0, 0.0)),
        ("position_w", (0.0, np.inf, -np.inf)),
        ("quaternion_wb", (np.nan, 0.0, 0.0, 0.0)),
        ("quaternion_wb", (0.0, 0.0, 0.0, 0.0)),
        ("quaternion_wb", (1.0, 1.0, 0.0, 0.0)),
    ],
)
def test_a_pose_that_is_none_is_refused_in_one_line_and_changes_nothing(
    field: str, value: tuple[float, ...]
) -> None:
    still = Still()
    bad = pose_at(0)
    bad[field] = value
    with pytest.raises(MeasurementError, match="cannot be used") as caught:
        still.estimator.initialize(bad)
    assert "\n" not in str(caught.value)
    assert not still.estimator.initialized
    still.correct()
    still.tick(5)
    before = still.estimator.memory.copy()
    bad["stamp_ns"] = still.stamp_ns
    with pytest.raises(MeasurementError):
        still.estimator.correct(bad, still.estimate)
    assert still.unchanged_since(before)


def test_a_batch_equals_its_single_flights(rng: np.random.Generator) -> None:
    count, gains = 3, estimation_record(EstimationParameters())
    imu, pose = np.zeros(count, IMU_SAMPLE), np.zeros(count, POSE_SAMPLE)
    batch, states = new_memory(count), np.zeros(count, STATE)
    estimates, outcomes = np.zeros(count, ESTIMATE), np.zeros(count, np.int64)
    singles = [new_memory() for _ in range(count)]
    state, estimate, outcome = np.zeros(1, STATE), np.zeros(1, ESTIMATE), np.zeros(1, np.int64)
    batch["initialized"] = 1
    for single in singles:
        single["initialized"] = 1
    pose["quaternion_wb"][:, 0] = 1.0
    for i in range(1, 60):
        imu["stamp_ns"] = pose["stamp_ns"] = i * PERIOD_NS
        imu["specific_force_b"] = rng.normal(size=(count, 3)) + np.array([0.0, 0.0, 9.81])
        imu["angular_velocity_b"] = rng.normal(size=(count, 3))
        pose["position_w"] = 0.1 * rng.normal(size=(count, 3))
        pose["position_w"][2, 0] += 9.0 * (i % 7 == 0)  # outside of the gate of the third
        pose["stamp_ns"][1] = 0  # too old for the second
        predict(batch, imu, gains, 0.002, states)
        correct(batch, pose, gains, estimates, outcomes)
        report(batch, estimates)
        third = Outcome.APPLIED if i % 7 else Outcome.OUTLIER
        assert outcomes.tolist() == [Outcome.APPLIED, Outcome.NOT_NEWER, third]
        for k, single in enumerate(singles):
            predict(single, imu[k : k + 1], gains, 0.002, state)
            assert state[0] == states[k]
            correct(single, pose[k : k + 1], gains, estimate, outcome)
    for k, single in enumerate(singles):
        assert single[0] == batch[k]
