"""Lateness and missed periods, from pairs of times made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from vehicle.flight.lateness import Lateness, LoopStatistics

MS = 1_000_000


def run(stamps_ms: list[float], late_us: dict[int, float] | None = None) -> list[LoopStatistics]:
    """Run ticks at their stamps plus a constant, some of them late by the given microseconds."""
    lateness, finished, constant = Lateness(), [], 7_654_321
    for k, stamp in enumerate(stamps_ms):
        stamp_ns = round(stamp * MS)
        late = round(1000 * late_us.get(k, 0.0)) if late_us else 0
        statistics = lateness.add(stamp_ns + constant + late, stamp_ns)
        if statistics is not None:
            finished.append(statistics)
    return finished


def test_a_punctual_loop_is_not_late_and_misses_nothing() -> None:
    first, second = run([2.0 * k for k in range(1100)])
    assert first == LoopStatistics(500.0, 0.0, 0.0, 0.0, 0.0)
    assert second == first


def test_percentiles_are_those_of_the_second() -> None:
    late = {k: float(k) for k in range(500)}  # 0 … 499 us
    (statistics,) = run([2.0 * k for k in range(501)], late)
    assert statistics.lateness_p50 == pytest.approx(250e-6)
    assert statistics.lateness_p99 == pytest.approx(495e-6)
    assert statistics.lateness_max == pytest.approx(499e-6)
    assert statistics.missed_share == 0.0


def test_a_lost_sample_is_a_missed_period() -> None:
    stamps = [2.0 * k for k in range(502) if k not in (100, 200, 201)]
    (statistics,) = run(stamps)
    assert statistics.rate == pytest.approx(497.0)
    assert statistics.missed_share == pytest.approx(3 / 500)


def test_a_silence_between_two_seconds_is_counted_too() -> None:
    stamps = [2.0 * k for k in range(500)] + [2.0 * k for k in range(1000, 1501)]
    first, second = run(stamps)
    assert first.missed_share == 0.0
    assert second.missed_share == pytest.approx(500 / 1000)


def test_a_tick_later_than_its_period_is_a_missed_one() -> None:
    (statistics,) = run([2.0 * k for k in range(501)], {10: 2001.0, 11: 1999.0})
    assert statistics.missed_share == pytest.approx(1 / 500)
    assert statistics.lateness_max == pytest.approx(2001e-6)


def test_whole_millisecond_stamps_of_400_hz_miss_nothing() -> None:
    stamps = [float(int(2.5 * k)) for k in range(402)]
    (statistics,) = run(stamps)
    assert statistics.missed_share == 0.0
    assert statistics.rate == pytest.approx(400.0)


def test_a_drifting_clock_does_not_look_late() -> None:
    lateness, worst = Lateness(), 0.0
    for k in range(30 * 500):
        statistics = lateness.add(round(2 * MS * k * (1 + 50e-6)), 2 * MS * k)
        if statistics is not None:
            worst = max(worst, statistics.lateness_max)
    assert 0.0 < worst < 110e-6  # 50 ppm over at most two seconds


def test_a_rate_beyond_the_buffer_closes_the_second_early() -> None:
    statistics = run([0.25 * k for k in range(2100)])[0]
    assert statistics.rate == pytest.approx(4000.0)


def test_the_histogram_counts_every_tick_of_the_finished_seconds() -> None:
    lateness, counted = Lateness(), 0
    late_us = [0.0, 49.9, 50.0, 99.0, 150.0, 300.0, 700.0, 1500.0, 3000.0, 7000.0]
    for k in range(1001):
        if lateness.add(2 * MS * k + round(1000 * late_us[k % 10]), 2 * MS * k) is not None:
            counted = k
    bounds = [0, 50, 100, 200, 500, 1000, 2000, 5000, np.inf]
    expected, _ = np.histogram([late_us[k % 10] for k in range(counted)], bounds)
    assert counted > 990
    assert lateness.histogram.tolist() == expected.tolist()
