"""Simulated tracker: rate, noise, delay, drop-outs, all deterministic."""

from __future__ import annotations

import numpy as np
import pytest

from bearing_sim import PoseMeasurement, SimulatedTracker, TrackerParameters
from quadrotor.plain_rotations import matrix_of, turned

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
HERE = np.array([0.3, -0.2, 1.1])
MS = 1_000_000


def track(
    parameters: TrackerParameters, seconds: float = 1.0, rate: int = 500
) -> list[PoseMeasurement]:
    tracker = SimulatedTracker(parameters)
    for k in range(round(seconds * rate)):
        tracker.observe(k * 1_000 * MS // rate, HERE, LEVEL)
    return tracker.due(10**12)


@pytest.mark.parametrize("rate", [20.0, 60.0, 100.0, 250.0, 500.0])
def test_poses_come_at_the_rate(rate: float) -> None:
    assert len(track(TrackerParameters(rate=rate), seconds=2.0)) == pytest.approx(2 * rate, abs=1)


def test_jittered_truth_of_the_trackers_own_rate_is_not_skipped() -> None:
    seed = 2
    jitter = np.random.default_rng(seed).uniform(-0.9, 0.9, 500)
    tracker = SimulatedTracker(TrackerParameters(rate=100.0))
    tracker.observe(0, HERE, LEVEL)
    for k, j in enumerate(jitter, start=1):
        tracker.observe(round((10 * k + j) * MS), HERE, LEVEL)
    assert len(tracker.due(10**12)) >= 499, f"seed {seed}"


def test_without_noise_the_truth_comes_out() -> None:
    [first, *_] = track(TrackerParameters(position_noise=0.0, attitude_noise=0.0))
    assert first.stamp_ns == 0
    np.testing.assert_array_equal(first.position_w, HERE)
    np.testing.assert_allclose(first.quaternion_wb, LEVEL, atol=1e-15)


def test_the_noise_has_its_standard_deviations() -> None:
    poses = track(TrackerParameters(rate=500, position_noise=0.01, attitude_noise=1.0), 8.0)
    positions = np.array([p.position_w for p in poses])
    vectors = np.degrees(2 * np.array([p.quaternion_wb[1:] for p in poses]))
    np.testing.assert_allclose(positions.std(axis=0), 0.01, rtol=0.06)
    np.testing.assert_allclose(vectors.std(axis=0), 1.0, rtol=0.06)
    np.testing.assert_allclose(positions.mean(axis=0), HERE, atol=0.001)


def test_a_pose_arrives_late_with_the_stamp_of_its_truth() -> None:
    tracker = SimulatedTracker(TrackerParameters(delay=0.02))
    tracker.observe(100 * MS, HERE, LEVEL)
    assert tracker.next_ns == 120 * MS
    assert tracker.due(119 * MS) == []
    [pose] = tracker.due(120 * MS)
    assert pose.stamp_ns == 100 * MS
    assert tracker.due(10**12) == []


def test_drop_outs_take_their_share_and_leave_the_noise_of_the_others() -> None:
    seed = 6
    every = {p.stamp_ns: p for p in track(TrackerParameters(rate=500, seed=seed), 4.0)}
    some = track(TrackerParameters(rate=500, seed=seed, drop_out=0.3), 4.0)
    assert len(some) == pytest.approx(0.7 * len(every), rel=0.06), f"seed {seed}"
    for pose in some:
        np.testing.assert_array_equal(pose.position_w, every[pose.stamp_ns].position_w)


def test_the_same_seed_gives_the_same_poses_and_another_does_not() -> None:
    one, two, other = (track(TrackerParameters(seed=s)) for s in (4, 4, 5))
    np.testing.assert_array_equal(one[7].quaternion_wb, two[7].quaternion_wb)
    assert not np.allclose(one[7].position_w, other[7].position_w)


def test_a_restarted_simulator_is_followed() -> None:
    tracker = SimulatedTracker(TrackerParameters(delay=0.1))
    tracker.observe(50_000 * MS, HERE, LEVEL)
    tracker.observe(0, HERE, LEVEL)
    assert [p.stamp_ns for p in tracker.due(200 * MS)] == [0]


def test_turning_by_a_vector_is_the_rotation_about_it() -> None:
    q = turned(LEVEL, [0.0, 0.0, np.pi / 2])
    np.testing.assert_allclose(matrix_of(q) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    tiny = turned(q, [1e-9, 0.0, 0.0])
    np.testing.assert_allclose(
        matrix_of(q).T @ matrix_of(tiny) @ [0, 1, 0], [0, 1, 1e-9], atol=1e-15
    )


def test_outliers_take_their_share_and_leave_the_other_poses_as_they_are() -> None:
    plain = track(TrackerParameters(), 20.0)
    some = track(TrackerParameters(outliers=0.1, outlier_position=0.5, outlier_attitude=30.0), 20.0)
    off = [np.linalg.norm(b.position_w - a.position_w) for a, b in zip(plain, some, strict=True)]
    turned_by = [
        np.degrees(2.0 * np.arccos(min(1.0, abs(float(a.quaternion_wb @ b.quaternion_wb)))))
        for a, b in zip(plain, some, strict=True)
    ]
    outlying = np.array(off) > 0.0
    assert 0.07 < outlying.mean() < 0.13
    np.testing.assert_allclose(np.array(off)[outlying], 0.5, rtol=1e-9)
    np.testing.assert_allclose(np.array(turned_by)[outlying], 30.0, rtol=1e-6)
    assert max(np.array(turned_by)[~outlying]) < 1e-5
    towards = [b.position_w - a.position_w for a, b in zip(plain, some, strict=True)]
    assert np.linalg.norm(np.array(towards)[outlying].mean(axis=0)) < 0.15  # in all directions
    again = track(
        TrackerParameters(outliers=0.1, outlier_position=0.5, outlier_attitude=30.0), 20.0
    )
    assert all((a.position_w == b.position_w).all() for a, b in zip(some, again, strict=True))


def test_a_stamp_error_moves_the_stamps_and_neither_poses_nor_their_arrival() -> None:
    plain, late = (track(TrackerParameters(stamp_error=error), 0.2) for error in (0.0, 0.03))
    assert [b.stamp_ns - a.stamp_ns for a, b in zip(plain, late, strict=True)] == [30 * MS] * 20
    assert all((a.position_w == b.position_w).all() for a, b in zip(plain, late, strict=True))
    tracker = SimulatedTracker(TrackerParameters(stamp_error=0.03, delay=0.02))
    tracker.observe(100 * MS, HERE, LEVEL)
    assert tracker.next_ns == 120 * MS
