"""Readings that an experiment gets: in order, bounded, missing ones counted."""

from __future__ import annotations

import numpy as np
import pytest

from bearing_sim import PoseMeasurement
from console.experiment_running import readings_feed
from console.experiment_running.readings_feed import ReadingsFeed
from quadrotor.errors import LinkError
from quadrotor.records import TICK
from tests.support.clock import Clock
from vehicle_link.messages import encode, header, new


@pytest.fixture
def feed() -> ReadingsFeed:
    made = ReadingsFeed(Clock())
    made.begin()
    return made


def packet(first: int, count: int = 5) -> np.ndarray:
    ticks = np.zeros(count, TICK)
    number = np.arange(first, first + count)
    ticks["imu"]["stamp_ns"] = number * 2_000_000
    ticks["imu"]["specific_force_b"][:, 2] = number
    ticks["imu"]["angular_velocity_b"][:, 0] = -number
    ticks["actuators"]["motor_references"][:, 3] = 10 + number
    ticks["actuators"]["wrench"][:, 0] = 20 + number
    return ticks


def test_each_look_has_every_tick_since_the_last_one_in_order(feed: ReadingsFeed) -> None:
    for k in range(3):
        feed.telemetry(k, packet(5 * k))
    seen = feed.imu()
    number = np.arange(15)
    np.testing.assert_allclose(seen.time, number * 2e-3)
    np.testing.assert_array_equal(seen.specific_force_b[:, 2], number)
    np.testing.assert_array_equal(seen.angular_velocity_b[:, 0], -number)
    np.testing.assert_array_equal(seen.motor_references[:, 3], 10 + number)
    np.testing.assert_array_equal(seen.wrench[:, 0], 20 + number)
    nothing = feed.imu()
    assert (nothing.time.shape, nothing.wrench.shape) == ((0,), (0, 4))
    assert feed.end() == 0


def test_packets_that_are_lost_or_late_are_gaps_over_the_counters_end_too(
    feed: ReadingsFeed,
) -> None:
    first = 2**32 - 2
    for sequence in (first, first + 1, 2, 1, 3):  # 0 is lost, 1 is late
        feed.telemetry(sequence % 2**32, packet(5 * (sequence % 1000)))
    assert len(feed.imu().time) == 4 * 5
    assert feed.end() == 2


def test_who_never_looks_loses_the_oldest(
    feed: ReadingsFeed, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(readings_feed, "KEPT_TICKS", 12)
    for k in range(4):
        feed.telemetry(k, packet(5 * k))
    np.testing.assert_allclose(feed.imu().time, np.arange(10, 20) * 2e-3)
    assert feed.end() == 2


def test_nothing_is_kept_without_an_experiment(feed: ReadingsFeed) -> None:
    feed.telemetry(0, packet(0))
    feed.end()
    feed.telemetry(7, packet(5))
    feed.bench(b"no message")
    feed.begin()
    assert len(feed.imu().time) == len(feed.bench_readings().time) == 0
    assert feed.end() == 0


def test_a_pose_counts_for_a_tenth_of_a_second() -> None:
    clock = Clock()
    feed = ReadingsFeed(clock)
    assert feed.tracked() is None
    feed.pose(PoseMeasurement(3_000_000_000, np.zeros(3), np.array([0.0, 1.0, 0.0, 0.0])))
    clock.now += 0.09
    tracked = feed.tracked()
    assert tracked is not None
    assert tracked.time == 3.0
    np.testing.assert_array_equal(tracked.quaternion_wb, [0, 1, 0, 0])
    clock.now += 0.02
    assert feed.tracked() is None


def test_bench_readings_come_in_order_and_what_is_none_says_so(feed: ReadingsFeed) -> None:
    for k in range(3):
        reading = new(
            "quadlab_msgs/BenchReading",
            header=header(k * 5_000_000),
            force=float(k),
            torque=0.5 * k,
            speed=float("nan"),
        )
        feed.bench(encode(reading))
    with pytest.raises(LinkError):
        feed.bench(b"\x00\x01")
    seen = feed.bench_readings()
    np.testing.assert_allclose(seen.time, [0.0, 0.005, 0.01])
    np.testing.assert_allclose(seen.force, [0, 1, 2])
    np.testing.assert_allclose(seen.torque, [0, 0.5, 1])
    assert np.isnan(seen.speed).all()
    assert len(feed.bench_readings().time) == 0
