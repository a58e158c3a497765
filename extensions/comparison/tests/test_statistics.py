"""Windows of the statistics: the last 10 s, and the session."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bearing_sim.pose_track import Pose
from extensions.comparison.comparison import EstimatorComparison
from extensions.comparison.statistics import ErrorStatistics, errors
from quadrotor.plain_rotations import quaternion_of
from quadrotor.records import TICK

MS = 1_000_000
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def test_lengths_of_errors_also_for_tiny_and_opposite_quaternions() -> None:
    true = Pose(0, (1.0, 2.0, 3.0), quaternion_of(0.1, -0.2, 0.3))
    states = np.zeros((4, 13))
    states[:, :3] = true.position_w
    states[1, :3] += (3e-9, 0.0, 4e-9)
    states[:, 6:10] = true.quaternion_wb
    states[2, 6:10] *= -1.0
    states[3, 6:10] = quaternion_of(0.0, 0.0, math.pi)
    lengths = np.array(errors(states, Pose(0, (1.0, 2.0, 3.0), true.quaternion_wb)))
    assert lengths[0] == pytest.approx((0.0, 0.0))
    assert lengths[1, 0] == pytest.approx(5e-9, rel=1e-6)
    assert lengths[2] == pytest.approx((0.0, 0.0))
    small = np.array(errors(states[:1], Pose(0, (1, 2, 3), quaternion_of(0.1, -0.2, 0.3 + 1e-9))))
    assert 1e-10 < small[0, 1] < 2e-9
    half = np.array(errors(states[3:], Pose(0, (1, 2, 3), (1.0, 0.0, 0.0, 0.0))))
    assert half[0, 1] == pytest.approx(math.pi)


def test_recent_is_the_last_ten_seconds_and_the_session_is_all() -> None:
    statistics = ErrorStatistics()
    for k in range(2000):  # 20 s
        statistics.add(k * 10 * MS, 3.0 if k < 500 else 0.5, 0.1)
    now_ns = 1999 * 10 * MS
    recent, session = statistics.recent(now_ns), statistics.session()
    assert recent.position_rms == pytest.approx(0.5)
    assert recent.position_max == 0.5
    assert session.position_max == 3.0
    assert session.position_rms == pytest.approx(math.sqrt((500 * 9 + 1500 * 0.25) / 2000))
    assert session.attitude_rms == pytest.approx(0.1)
    assert statistics.duration == pytest.approx(19.99)
    assert math.isnan(statistics.recent(now_ns + 11_000 * MS).position_rms)


def test_nothing_and_nan_give_no_statistics() -> None:
    statistics = ErrorStatistics()
    statistics.add(5, math.nan, 0.1)
    assert all(math.isnan(value) for value in statistics.session())
    assert all(math.isnan(value) for value in statistics.recent(5))
    assert statistics.duration == 0.0


def test_errors_that_do_not_count_are_recent_only() -> None:
    statistics = ErrorStatistics()
    statistics.add(10 * MS, 1.0, 0.0)
    statistics.add(20 * MS, 2.0, 0.0, counts=False)
    assert statistics.session().position_max == 1.0
    assert statistics.recent(20 * MS).position_max == 2.0
    statistics.begin()
    assert math.isnan(statistics.session().position_max)
    assert statistics.recent(20 * MS).position_max == 2.0


def test_arming_begins_a_session_and_disarming_ends_it() -> None:
    comparison = EstimatorComparison()

    def second(number: int, error: float) -> None:
        for k in range(100 * number, 100 * number + 100):
            ticks = np.zeros(1, TICK)
            ticks["imu"]["stamp_ns"] = 10 * MS * (k + 1)
            ticks["state"]["position_w"], ticks["state"]["quaternion_wb"] = (error, 0, 0), LEVEL
            comparison.truth(10 * MS * (k + 1), np.zeros(3), LEVEL)
            comparison.ticks(ticks)

    def told() -> tuple[float, float, float]:
        report = comparison.report()
        assert report is not None
        [own] = report.results
        return own.session.position_max, own.recent.position_max, report.duration

    second(0, 0.3)
    assert told() == pytest.approx((0.3, 0.3, 0.99))  # never armed: since the start
    comparison.status(armed=True, starting=False)
    second(1, 0.1)
    second(2, 0.2)
    assert told() == pytest.approx((0.2, 0.3, 1.99))
    comparison.status(armed=False, starting=False)
    second(3, 0.7)
    assert told() == pytest.approx((0.2, 0.7, 1.99))  # the flight's, which remain
    comparison.status(armed=True, starting=False)
    second(4, 0.05)
    assert told() == pytest.approx((0.05, 0.7, 0.99))
