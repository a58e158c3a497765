"""The gyroscope's low-pass is exact, so stable at any rate; its notch removes one frequency."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from estimation.memory import new_memory
from estimation.parameters import EstimationParameters, estimation_record
from estimation.rate_filter import filter_rate
from quadrotor.records import Array

NO_BIAS = np.zeros(3)


def filtered(readings: Array, dt: float, start: Array | None = None, **parameters: float) -> Array:
    """Return the filter's output for each of the readings (N, 3), from `start`."""
    g: Any = estimation_record(EstimationParameters(**parameters))[0]  # type: ignore[arg-type]
    m: Any = new_memory()[0]
    m["filtered_rate_b"] = 0.0 if start is None else start
    return np.array([step(m, reading, NO_BIAS, g, dt) for reading in readings])


def step(m: Any, reading: Array, bias: Array, g: Any, dt: float) -> Array:
    filter_rate(m, reading, bias, g, dt)
    out: Array = m["filtered_rate_b"].copy()
    return out


@pytest.mark.parametrize("rate", [20.0, 60.0, 250.0, 470.0, 500.0, 1000.0])
def test_step_response_never_overshoots_and_is_the_exact_exponential(rate: float) -> None:
    held = np.array([1.0, -2.0, 0.5])
    found = filtered(np.tile(held, (39, 1)), 1.0 / rate, rate_low_pass=150.0)
    share = 1.0 - np.exp(-2.0 * math.pi * 150.0 * np.arange(1, 40) / rate)
    np.testing.assert_allclose(found, share[:, None] * held, rtol=1e-12)


def test_ten_short_steps_equal_a_long_one() -> None:
    held = np.array([[3.0, 0.0, -1.0]])
    short = filtered(np.repeat(held, 10, axis=0), 0.001, np.ones(3), rate_low_pass=40.0)
    long = filtered(held, 0.010, np.ones(3), rate_low_pass=40.0)
    np.testing.assert_allclose(short[-1], long[-1], rtol=1e-13)


def test_bias_is_taken_off() -> None:
    bias = np.array([0.1, 0.2, -0.3])
    g: Any = estimation_record(EstimationParameters())[0]
    np.testing.assert_allclose(step(new_memory()[0], bias + 1.0, bias, g, 1.0), 1.0, rtol=1e-12)


def test_notch_takes_out_its_frequency_and_passes_the_others_as_its_transfer_function_says() -> (
    None
):
    rate, notch, width = 500.0, 76.0, 20.0
    time = np.arange(2000) / rate
    for hertz in (2.0, 10.0, 60.0, 76.0, 90.0, 150.0):
        wave = np.sin(2.0 * math.pi * hertz * time)
        found = filtered(
            np.tile(wave[:, None], (1, 3)),
            1.0 / rate,
            rate_low_pass=1000.0,
            rate_notch=notch,
            rate_notch_width=width,
        )
        plain = filtered(np.tile(wave[:, None], (1, 3)), 1.0 / rate, rate_low_pass=1000.0)
        # s of the bilinear transform, which is exact at the notch's frequency.
        s = 1j * 2.0 * math.pi * notch * math.tan(math.pi * hertz / rate)
        s /= math.tan(math.pi * notch / rate)
        w, b = 2.0 * math.pi * notch, 2.0 * math.pi * width
        expected = abs((s * s + w * w) / (s * s + b * s + w * w))
        settled = slice(1000, None)
        ratio = found[settled].std(axis=0) / plain[settled].std(axis=0)
        np.testing.assert_allclose(ratio, expected, atol=2e-3)


def test_notch_delays_slow_motion_as_its_parameter_says() -> None:
    rate, notch, width = 500.0, 76.0, 20.0
    ramp = np.tile((np.arange(1000) / rate)[:, None], (1, 3))  # 1 rad/s^2
    plain = filtered(ramp, 1.0 / rate)
    notched = filtered(ramp, 1.0 / rate, rate_notch=notch, rate_notch_width=width)
    delay = width / (2.0 * math.pi * notch**2)
    # The frequency warp of the bilinear transform makes it 8 % less at this rate.
    np.testing.assert_allclose((plain - notched)[-1], delay, rtol=0.1)


def test_switching_a_notch_on_or_to_another_frequency_causes_no_jump() -> None:
    m: Any = new_memory()[0]
    held = np.array([0.4, -0.2, 0.1])
    m["filtered_rate_b"] = held
    for notch in (0.0, 76.0, 76.0, 90.0, 0.0, 120.0):
        g: Any = estimation_record(EstimationParameters(rate_notch=notch))[0]
        np.testing.assert_allclose(step(m, held, NO_BIAS, g, 0.002), held, rtol=1e-12)


def test_notch_above_what_the_sampling_shows_is_left_out() -> None:
    wave = np.random.default_rng(3).normal(size=(200, 3))
    found = filtered(wave, 0.01, rate_notch=76.0)  # 100 Hz
    np.testing.assert_array_equal(found, filtered(wave, 0.01))
