"""The error-state filter when measurements are late, ahead, or contradict it."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from estimation.error_state.estimator import ErrorStateEstimator
from estimation.outcome import LATEST_NS, Agreement, Outcome
from estimation.parameters import EstimationParameters
from quadrotor.records import (
    BEARINGS_SAMPLE,
    ESTIMATE,
    IMU_SAMPLE,
    POSE_SAMPLE,
    Array,
    Record,
    new_state,
)

MS = 1_000_000
BEACONS = np.array([[1.0, 1.0, 0.1], [-1.0, 1.0, 0.1], [-1.0, -1.0, 0.1], [1.0, -1.0, 0.1]])
SIGMA = math.radians(1.5)
AMPLITUDE, PULSE = np.array([0.5, 0.3, 0.2]), np.array([1.3, 1.7, 2.1])  # m, rad/s
MIDDLE = np.array([0.0, 0.0, 1.2])


def where(t: float) -> Array:
    place: Array = MIDDLE + AMPLITUDE * np.sin(PULSE * t)
    return place


def pose_at(stamp_ns: int, moved: Any = (0.0, 0.0, 0.0)) -> Record:
    pose = np.zeros(1, POSE_SAMPLE)
    pose[0] = stamp_ns, where(1e-9 * stamp_ns) + np.asarray(moved), (1.0, 0.0, 0.0, 0.0)
    return pose


class Swing:
    """Level vehicle that swings about a point, with white noise on IMU and bearings.

    Args:
        rate: rate of the IMU, Hz.
        poses, frames: Hz, whole divisors of it; 0 for none.
        pose_late, frame_late: s, negative when their stamps are ahead of the IMU.
    """

    def __init__(
        self,
        seed: int,
        rate: int = 500,
        poses: int = 100,
        frames: int = 0,
        pose_late: float = 0.0,
        frame_late: float = 0.0,
        **settings: Any,
    ) -> None:
        p = EstimationParameters(measurement_timeout=0.5, **settings)
        self.estimator = ErrorStateEstimator(p)
        self.state, self.estimate = new_state(), np.zeros(1, ESTIMATE)
        self.imu = np.zeros(1, IMU_SAMPLE)
        self.period_ns = 1_000_000_000 // rate
        self.every = {
            "pose": rate // poses if poses else 0,
            "frame": rate // frames if frames else 0,
        }
        self.late_ns = {"pose": round(1e9 * pose_late), "frame": round(1e9 * frame_late)}
        self.moved: Array = np.zeros(3)  # m, displacement of the tracker
        self.beacons = BEACONS
        self.rng = np.random.default_rng(seed)
        self.tick = 0
        self.restarts: list[str] = []

    @property
    def now_ns(self) -> int:
        return 1_000_000_000 + self.tick * self.period_ns

    @property
    def error(self) -> float:
        """Return the position error, m."""
        true = where(1e-9 * self.now_ns)
        return float(np.linalg.norm(self.state["position_w"][0] - true))

    def fly(self, seconds: float, look: Callable[[], object] = lambda: None) -> Swing:
        """Fly, and call `look` after each tick."""
        for _ in range(round(1e9 * seconds) // self.period_ns):
            self.tick += 1
            t = 1e-9 * self.now_ns
            force = -AMPLITUDE * PULSE**2 * np.sin(PULSE * t) + np.array([0.0, 0.0, 9.81])
            self.imu[0] = (
                self.now_ns,
                force + self.rng.normal(0, 0.05, 3),
                self.rng.normal(0, 0.005, 3),
            )
            self.estimator.predict(self.imu, 1e-9 * self.period_ns, self.state)
            if self._due("pose"):
                pose = pose_at(self.now_ns - self.late_ns["pose"], self.moved)
                self.estimator.correct(pose, self.estimate)
            if self._due("frame"):
                self.estimator.correct_bearings(self.frame(), self.estimate)
            self.estimator.report(self.estimate)
            self.restarts += self.estimator.restarts
            self.estimator.restarts.clear()
            look()
        return self

    def frame(self) -> Record:
        frame = np.zeros(1, BEARINGS_SAMPLE)
        stamp_ns = self.now_ns - self.late_ns["frame"]
        away = self.beacons - where(1e-9 * stamp_ns)
        away /= np.linalg.norm(away, axis=1)[:, None]
        away += self.rng.normal(0, SIGMA, away.shape)
        away /= np.linalg.norm(away, axis=1)[:, None]
        count = len(self.beacons)
        frame["stamp_ns"], frame["count"], frame["sigma"] = stamp_ns, count, SIGMA
        frame["beacon_w"][0, :count], frame["bearing_b"][0, :count] = self.beacons, away
        return frame

    def _due(self, kind: str) -> bool:
        return self.every[kind] > 0 and self.tick % self.every[kind] == 0


@pytest.fixture
def seed(request: pytest.FixtureRequest) -> int:
    found = zlib.crc32(request.node.name.encode())
    print(f"seed {found}")
    return found


# ---------------------------------------------------------------------- late
@pytest.mark.parametrize(
    ("rate", "poses", "frames", "late"),
    [
        (500, 100, 25, 0.15),
        (500, 250, 25, 0.15),
        (1000, 200, 25, 0.15),
        (1000, 0, 25, 0.3),
        (1000, 500, 100, 0.5),
    ],
)
def test_late_bearings_are_used_at_any_rate_of_samples_and_poses(
    rate: int, poses: int, frames: int, late: float, seed: int
) -> None:
    swing = Swing(seed, rate, poses, frames, frame_late=late)
    if not poses:
        swing.estimator.correct(pose_at(swing.now_ns), swing.estimate)
    before = int(swing.estimator.memory["outcomes"][0, Outcome.APPLIED])
    swing.fly(late + 0.1)  # the first ones were measured before the start
    begun = swing.estimator.ignored
    swing.fly(3.0)
    assert swing.estimator.ignored == begun
    used = int(swing.estimator.memory["outcomes"][0, Outcome.APPLIED]) - before
    assert used > 3.0 * (poses + frames)
    assert swing.error < (0.1 if not poses else 0.02)


def test_a_measurement_later_than_any_may_be_is_counted(seed: int) -> None:
    swing = Swing(seed, 500, 100, 25, frame_late=1e-9 * LATEST_NS + 0.01).fly(3.0)
    assert swing.estimator.ignored[Outcome.TOO_OLD] == 75
    assert swing.estimate["measurements_ignored"][0] == 75
    assert swing.error < 0.01


# ---------------------------------------------------------------------- ahead, and lost
@pytest.mark.parametrize("late", [0.0, -0.005])
def test_a_tracker_that_jumped_is_followed_which_is_said_and_flagged(
    late: float, seed: int
) -> None:
    """Stamps 5 ms ahead of the IMU give the same result as stamps in time."""
    swing = Swing(seed, pose_late=late).fly(2.0)
    assert swing.estimator.converged
    swing.moved = np.array([1.0, 0.0, 0.0])
    seen: list[tuple[int, bool, float]] = []

    def look() -> None:
        innovation = float(np.linalg.norm(swing.estimate["position_innovation_w"][0]))
        seen.append((int(swing.estimate["agreement"][0]), swing.estimator.converged, innovation))

    swing.fly(0.45, look)
    assert not swing.restarts
    assert seen[-1][0] == Agreement.JUMPED
    assert seen[-1][2] == pytest.approx(1.0, abs=0.05)  # not a correction: there is none
    assert swing.error < 0.1
    swing.fly(1.5, look)
    assert len(swing.restarts) == 1
    assert "1.0" in swing.restarts[0]
    assert swing.error == pytest.approx(1.0, abs=0.02)
    assert seen[-1][:2] == (Agreement.USED, True)
    flags = [flag for flag, _, _ in seen]
    assert not any(fit for flag, fit, _ in seen[flags.index(Agreement.JUMPED) :] if flag)
    moved = flags.index(Agreement.MOVED)
    assert set(flags[moved : moved + 50]) == {Agreement.MOVED}


def test_a_moving_vehicle_keeps_its_velocity_when_the_tracker_jumps(seed: int) -> None:
    swing = Swing(seed).fly(2.4)
    swing.moved = np.array([0.5, 0.0, 0.0])
    errors: list[float] = []

    def look() -> None:
        true = AMPLITUDE * PULSE * np.cos(PULSE * 1e-9 * swing.now_ns)
        errors.append(float(np.linalg.norm(swing.state["velocity_w"][0] - true)))

    swing.fly(1.0, look)
    assert len(swing.restarts) == 1
    assert max(errors) < 0.1


@pytest.mark.parametrize("late", [0.005, -0.005])
def test_stamps_a_little_off_the_imu_keep_a_filter_of_bearings_alive(
    late: float, seed: int
) -> None:
    swing = Swing(seed, poses=0, frames=25, frame_late=late)
    swing.estimator.correct(pose_at(swing.now_ns), swing.estimate)
    swing.fly(2.0)
    swing.beacons = BEACONS + np.array([1.5, 0.0, 0.0])  # they are not where the filter assumes
    frame = swing.frame
    swing.frame = lambda: _believed(frame())  # type: ignore[method-assign]
    swing.fly(2.0)
    assert len(swing.restarts) == 1
    assert swing.estimator.measurement_age < 0.1
    assert swing.estimate["agreement"][0] == Agreement.USED


def _believed(frame: Record) -> Record:
    frame["beacon_w"][0, :4] = BEACONS
    return frame


def test_chance_outliers_are_refused_and_no_jump(seed: int) -> None:
    swing = Swing(seed).fly(1.0)
    for _ in range(50):
        swing.moved = swing.rng.normal(0, 1.0, 3)
        swing.fly(0.01)
        assert swing.estimate["agreement"][0] == Agreement.REFUSED
        swing.moved = np.zeros(3)
        swing.fly(0.01)
        assert swing.estimate["agreement"][0] == Agreement.USED
    assert swing.estimate["measurements_refused"][0] == 50
    assert not swing.restarts


def test_an_estimate_that_drifted_without_measurements_is_told_from_a_jump(seed: int) -> None:
    swing = Swing(seed).fly(1.0)
    every, swing.every["pose"] = swing.every["pose"], 0
    swing.fly(0.4)
    swing.every["pose"], swing.moved = every, np.array([3.0, 0.0, 0.0])
    seen: set[int] = set()
    swing.fly(0.3, lambda: seen.add(int(swing.estimate["agreement"][0])))
    assert Agreement.DRIFTED in seen
    assert Agreement.JUMPED not in seen
    assert len(swing.restarts) == 1


# ---------------------------------------------------------------------- the innovation
def test_the_innovation_told_is_that_before_the_correction(seed: int) -> None:
    """After seconds of poses, the correction is a small share of one pose's residual."""
    swing = Swing(seed).fly(3.0)
    swing.moved = np.array([0.004, 0.0, 0.0])
    swing.fly(0.01)
    told = swing.estimate["position_innovation_w"][0, 0]
    assert told == pytest.approx(0.004, abs=0.001)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_bearings_tell_the_shift_that_they_see(count: int, seed: int) -> None:
    """The shift is known from any number of bearings, in the directions that they see."""
    swing = Swing(seed, poses=100).fly(2.0)
    swing.beacons = BEACONS[:count]
    frame, there = swing.frame(), where(1e-9 * swing.now_ns)
    shift = np.array([0.15, 0.1, -0.1])
    away = BEACONS[:count] - (there + shift)
    away /= np.linalg.norm(away, axis=1)[:, None]
    frame["bearing_b"][0, :count] = away
    swing.estimator.correct_bearings(frame, swing.estimate)
    swing.estimator.report(swing.estimate)
    told = swing.estimate["position_innovation_w"][0]
    d = (BEACONS[:count] - there) / np.linalg.norm(BEACONS[:count] - there, axis=1)[:, None]
    seen = sum(np.eye(3) - np.outer(one, one) for one in d) / count
    _, axes = np.linalg.eigh(seen)
    blind = 1 if count == 1 else 0  # the distance to a single one
    np.testing.assert_allclose(axes.T[blind:] @ told, axes.T[blind:] @ shift, atol=0.035)
    assert np.linalg.norm(axes.T[:blind] @ told) < 0.02
