"""Readings of further sensors: numbers that correct the error-state filter, and are gated."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.error_state.estimator import ErrorStateEstimator
from estimation.outcome import JudgedReading, Outcome
from estimation.parameters import EstimationParameters
from quadrotor.errors import MeasurementError
from quadrotor.records import (
    ESTIMATE,
    IMU_SAMPLE,
    READING_SAMPLE,
    Array,
    Record,
    new_state,
    pose_sample,
)
from quadrotor.rotations import quaternion_exp

ANCHORS_W = np.array([[3.0, 3.0, 2.0], [-3.0, 3.0, 0.2], [-3.0, -3.0, 2.0], [3.0, -3.0, 0.2]])
PLACE_W = np.array([0.3, -0.2, 1.0])
SIGMA, BIAS = 0.05, 0.05  # m, m/s^2
TICK_NS = 2_000_000
LEVEL = (1.0, 0.0, 0.0, 0.0)


def range_to(anchor_w: Array, measured: float, stamp_ns: int, at_w: Array = PLACE_W) -> Record:
    """Return a range (m) to an anchor, linearised at a place with level attitude."""
    away = at_w - anchor_w
    reading = np.zeros(1, READING_SAMPLE)
    reading["stamp_ns"], reading["position_w"], reading["quaternion_wb"] = stamp_ns, at_w, LEVEL
    reading["rest"], reading["sigma"] = measured - np.linalg.norm(away), SIGMA
    reading["row"][0, :3] = away / np.linalg.norm(away)
    return reading


class Still:
    """A filter on a vehicle at rest, whose accelerometer has a bias that it does not know."""

    def __init__(self, bias: float = BIAS) -> None:
        self.filter = ErrorStateEstimator(EstimationParameters())
        self.state, self.imu, self.ticks = new_state(), np.zeros(1, IMU_SAMPLE), 0
        self.imu["specific_force_b"] = (bias, 0.0, 9.81)
        self.estimate = np.zeros(1, ESTIMATE)
        self.filter.initialize(pose_sample(0, PLACE_W, LEVEL))
        self.tick()

    @property
    def now_ns(self) -> int:
        return TICK_NS * self.ticks

    def tick(self, count: int = 1) -> None:
        for _ in range(count):
            self.ticks += 1
            self.imu["stamp_ns"] = self.now_ns
            self.filter.predict(self.imu, 0.002, self.state)

    def range(self, k: int, off: float = 0.0, late_ns: int = 0) -> JudgedReading:
        measured = float(np.linalg.norm(PLACE_W - ANCHORS_W[k])) + off
        return self.filter.correct_reading(
            range_to(ANCHORS_W[k], measured, self.now_ns - late_ns, self.state["position_w"][0])
        )

    @property
    def error(self) -> float:
        return float(np.linalg.norm(self.state["position_w"][0] - PLACE_W))


def test_ranges_to_four_anchors_hold_the_position_that_the_imu_alone_loses() -> None:
    alone, ranged, noise = Still(), Still(), np.random.default_rng(24)
    for k in range(200):  # 4 s
        alone.tick(10)
        ranged.tick(10)
        ranged.range(k % 4, float(noise.normal(0.0, SIGMA)))
    assert alone.error > 0.3
    assert ranged.error < 0.1


def test_a_late_reading_acts_at_its_own_time() -> None:
    timely, late = Still(), Still()
    for still, delay in ((timely, 0), (late, 15)):
        still.tick(100)
        at_w = still.state["position_w"][0].copy()
        stamp_ns = still.now_ns
        still.tick(delay)
        reading = range_to(ANCHORS_W[0], 4.0, stamp_ns, at_w)
        assert still.filter.correct_reading(reading).outcome is Outcome.APPLIED
        still.tick(30 - delay)
    assert late.state["position_w"] == pytest.approx(timely.state["position_w"], abs=1e-12)


def test_readings_of_one_moment_are_all_used() -> None:
    still = Still()
    still.tick(100)
    assert [still.range(k).outcome for k in range(4)] == [Outcome.APPLIED] * 4


@pytest.mark.parametrize("late", [0, 10])
def test_a_reading_is_told_with_its_residual_and_the_gate_that_decides(late: int) -> None:
    """The residual is to the filter's own prediction, also where later events are repeated."""
    probe, at_w = Still(), PLACE_W + np.array([0.0, 0.1, 0.0])
    probe.tick(100)
    off = probe.range(0, off=1.0).gate
    assert off > 2.0 * SIGMA
    for factor, judged in ((0.99, Outcome.APPLIED), (1.01, Outcome.OUTLIER)):
        still = Still()
        still.tick(100)
        before_w, stamp_ns = still.state["position_w"][0].copy(), still.now_ns
        if late:
            still.tick(late)
            still.range(1)
        measured = float(np.linalg.norm(before_w - ANCHORS_W[0])) + factor * off
        found = still.filter.correct_reading(range_to(ANCHORS_W[0], measured, stamp_ns, at_w))
        assert found.outcome is judged
        assert found.residual == pytest.approx(factor * off, abs=2e-3)
        assert found.gate == pytest.approx(off, rel=1e-3)


def test_a_reading_tells_the_attitude_by_its_row() -> None:
    """A row that is a turn about x alone corrects that, and the filter turns."""
    still = Still(bias=0.0)
    still.tick(100)
    reading = np.zeros(1, READING_SAMPLE)
    reading["stamp_ns"], reading["position_w"], reading["sigma"] = still.now_ns, PLACE_W, 1e-4
    reading["quaternion_wb"] = quaternion_exp(np.array([0.02, 0.0, 0.0]))
    reading["row"][0, 3] = 1.0  # at 0.02 rad about x it measured 0.01 rad less than expected
    reading["rest"] = -0.01
    still.filter.correct_reading(reading)
    still.tick()
    assert 2.0 * still.state["quaternion_wb"][0, 1] == pytest.approx(0.01, abs=1e-3)


def test_an_outlier_is_refused_and_nothing_counts_as_a_measurement() -> None:
    still = Still()
    still.tick(100)
    before, covariance = still.state.copy(), still.filter.covariance
    age, counts = still.filter.measurement_age, still.filter.ignored
    assert still.range(0, off=5.0).outcome is Outcome.OUTLIER
    assert (still.filter.covariance.diagonal() >= covariance.diagonal()).all()
    assert still.range(0).outcome is Outcome.APPLIED
    for _ in range(50):
        still.range(1, off=5.0)  # neither restarts it nor makes it doubt itself
    still.tick()
    assert still.state["position_w"] == pytest.approx(before["position_w"], abs=0.02)
    assert still.filter.measurement_age == pytest.approx(age + 0.002)
    assert (still.filter.ignored, still.filter.inconsistency) == (counts, "")
    assert still.filter.restarts == []


@pytest.mark.parametrize(
    ("name", "value"),
    [("rest", math.nan), ("row", math.inf), ("sigma", 0.0), ("quaternion_wb", 0.0)],
)
def test_numbers_that_cannot_be_are_refused(name: str, value: float) -> None:
    still = Still()
    reading = range_to(ANCHORS_W[0], 4.0, still.now_ns)
    reading[name] = value
    with pytest.raises(MeasurementError, match=r"reading .* cannot be used: allowed are finite"):
        still.filter.correct_reading(reading)


def test_a_reading_starts_no_filter() -> None:
    idle = ErrorStateEstimator(EstimationParameters())
    outcome, *numbers = idle.correct_reading(range_to(ANCHORS_W[0], 4.0, 0))
    assert outcome is Outcome.TOO_OLD
    assert np.isnan(numbers).all()
    assert not idle.initialized
