"""Parameters, presets and the warnings before a flight."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.complementary import ComplementaryEstimator
from estimation.parameters import (
    ESTIMATION_GAINS,
    PRESETS,
    EstimationParameters,
    estimation_record,
)
from estimation.stability import gain_warnings


def test_paper_preset_is_the_double_pole_of_the_printed_gains() -> None:
    omega = EstimationParameters(**PRESETS["paper"]).position_bandwidth
    assert 2.0 * omega == pytest.approx(126.3, abs=0.05)
    assert omega**2 == pytest.approx(3987.3, rel=3e-4)
    assert EstimationParameters(**PRESETS["paper"]).attitude_bandwidth == 62.8


def test_record_carries_every_gain() -> None:
    parameters = EstimationParameters()
    record = estimation_record(parameters)
    for name in ESTIMATION_GAINS.names or ():
        assert record[name][0] == getattr(parameters, name)


def test_nothing_is_wrong_with_the_defaults_at_100_hz_nor_with_the_bearings_at_30() -> None:
    assert ComplementaryEstimator().warnings(100.0) == []
    assert gain_warnings(EstimationParameters(**PRESETS["bearings"]), 30.0) == []
    assert gain_warnings(EstimationParameters(**PRESETS["paper"]), 100.0) == []


def test_the_papers_gains_follow_the_noise_at_30_hz_and_the_warning_says_what_to_set() -> None:
    lines = gain_warnings(EstimationParameters(**PRESETS["paper"]), 30.0)
    assert [line.split()[0] for line in lines] == ["position_bandwidth"]
    advised = float(lines[0].split("below ")[1].split()[0])
    mended = EstimationParameters(**PRESETS["paper"] | {"position_bandwidth": 0.99 * advised})
    assert gain_warnings(mended, 30.0) == []


def test_attitude_gain_too_fast_for_the_rate_is_named() -> None:
    lines = gain_warnings(EstimationParameters(attitude_bandwidth=62.8), 20.0)
    assert len(lines) == 1
    assert lines[0].startswith("attitude_bandwidth 62.8")


def test_timeout_shorter_than_the_period_is_named() -> None:
    lines = gain_warnings(EstimationParameters(), 10.0)
    assert len(lines) == 1
    assert lines[0].startswith("measurement_timeout 0.1 s")


def test_bias_pole_as_fast_as_its_state_is_named() -> None:
    lines = gain_warnings(EstimationParameters(accelerometer_bias_bandwidth=6.0), 100.0)
    assert len(lines) == 1
    assert lines[0].startswith("accelerometer_bias_bandwidth 6")


@pytest.mark.parametrize("rate", [0.0, -1.0, math.inf, np.nan])
def test_no_rate_means_no_pose(rate: float) -> None:
    assert gain_warnings(EstimationParameters(), rate) == [
        "no pose comes: position and velocity are only predicted"
    ]
