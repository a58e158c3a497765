"""Parameters, presets and the warnings before a flight."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.attitude_filter import attitude_gains
from estimation.complementary import ComplementaryEstimator
from estimation.gains import PRINTED, ContinuousGains, continuous_gains
from estimation.parameters import ESTIMATION_GAINS, PRESETS, EstimationParameters, estimation_record
from estimation.stability import gain_warnings, lowest_stable_rate, printed_radius
from estimation.translation_observer import translation_gains


def test_paper_preset_is_the_double_pole_of_the_printed_gains() -> None:
    omega = EstimationParameters.model_validate(PRESETS["paper"]).position_bandwidth
    assert 2.0 * omega == pytest.approx(126.3, abs=0.05)
    assert omega**2 == pytest.approx(3987.3, rel=3e-4)
    assert EstimationParameters.model_validate(PRESETS["paper"]).attitude_bandwidth == 62.8


def test_record_carries_every_gain() -> None:
    parameters = EstimationParameters()
    record = estimation_record(parameters)
    for name in ESTIMATION_GAINS.names or ():
        unit = math.radians(1.0) if name == "pose_attitude_noise" else 1.0
        assert record[name][0] == pytest.approx(unit * getattr(parameters, name), rel=1e-15)


def test_nothing_is_wrong_with_the_defaults_at_100_hz_nor_with_the_bearings_at_30() -> None:
    assert ComplementaryEstimator().warnings(100.0) == []
    assert gain_warnings(EstimationParameters.model_validate(PRESETS["bearings"]), 30.0) == []
    assert gain_warnings(EstimationParameters.model_validate(PRESETS["paper"]), 100.0) == []


def test_the_papers_gains_follow_the_noise_at_30_hz_and_the_warning_says_what_to_set() -> None:
    lines = gain_warnings(EstimationParameters.model_validate(PRESETS["paper"]), 30.0)
    names = ["position_bandwidth", "attitude_bandwidth"]
    assert [line.split()[0] for line in lines] == names
    advised = [float(line.split("below ")[-1].split()[0]) for line in lines]
    less = {name: 0.99 * most for name, most in zip(names, advised, strict=True)}
    mended = EstimationParameters.model_validate(PRESETS["paper"] | less)
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


# ---------------------------------------------------------------------- forms of the gains
def test_printed_gains_are_the_papers_poles_and_come_back() -> None:
    poles = EstimationParameters(
        position_bandwidth=math.sqrt(PRINTED.K_v), attitude_bandwidth=PRINTED.K_q
    )
    assert poles.position_bandwidth == pytest.approx(63.15, abs=0.01)
    back = continuous_gains(poles)
    assert back.K_p == pytest.approx(PRINTED.K_p, rel=1e-3)
    assert back.K_v == pytest.approx(PRINTED.K_v)
    assert back.K_q == PRINTED.K_q


@pytest.mark.parametrize("rate", [10.0, 30.0, 100.0, 500.0])
def test_gains_per_measurement_follow_from_the_poles(rate: float) -> None:
    parameters = EstimationParameters(position_bandwidth=5.0, attitude_bandwidth=2.0)
    p, interval = math.exp(-5.0 / rate), 1.0 / rate
    position, velocity, _ = translation_gains(parameters.position_bandwidth, 0.0, interval)
    attitude, _ = attitude_gains(parameters.attitude_bandwidth, 0.0, interval)
    assert position == pytest.approx(1.0 - p * p)
    assert velocity == pytest.approx((1.0 - p) ** 2 * rate)
    assert attitude == pytest.approx(1.0 - math.exp(-2.0 / rate))


def test_printed_gains_times_the_period_diverge_below_76_hz_by_their_spectral_radius() -> None:
    least = lowest_stable_rate(PRINTED)
    assert least == pytest.approx(76.2, abs=0.1)
    for rate, bounded in ((0.99 * least, False), (1.01 * least, True)):
        assert (printed_radius(PRINTED, rate) < 1.0) == bounded
        error, T = np.array([1.0, 0.0]), 1.0 / rate
        for _ in range(3000):
            error = np.array([error[0] + T * error[1], error[1]])
            error = error - T * np.array([PRINTED.K_p, PRINTED.K_v]) * error[0]
        assert bool(np.abs(error).max() < 1e3) == bounded


def test_the_warning_below_76_hz_gives_radius_and_rate_and_none_comes_above() -> None:
    line = gain_warnings(EstimationParameters.model_validate(PRESETS["paper"]), 70.0)[0]
    assert "spectral radius 1." in line
    assert "stable above 76.2 Hz" in line
    assert gain_warnings(EstimationParameters.model_validate(PRESETS["paper"]), 77.0) == []


@pytest.mark.parametrize("rate", [5.0, 30.0, 60.0, 76.0, 77.0, 126.0, 200.0, 1000.0])
@pytest.mark.parametrize("gains", [PRINTED, ContinuousGains(5.0, 40.0, 1.0)])
def test_spectral_radius_is_that_of_the_matrix(gains: ContinuousGains, rate: float) -> None:
    T = 1.0 / rate
    F = np.array([[1.0, T], [0.0, 1.0]])
    correction = np.array([[1.0 - T * gains.K_p, 0.0], [-T * gains.K_v, 1.0]])
    translation = np.abs(np.linalg.eigvals(correction @ F)).max()
    wanted = max(float(translation), abs(1.0 - T * gains.K_q))
    assert printed_radius(gains, rate) == pytest.approx(wanted, abs=1e-9)
