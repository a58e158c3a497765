"""The gyroscope low-pass is exact, hence stable at any rate."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.rate_filter import low_pass


@pytest.mark.parametrize("rate", [20.0, 60.0, 250.0, 470.0, 500.0, 1000.0])
def test_step_response_never_overshoots_and_is_the_exact_exponential(rate: float) -> None:
    filtered, bias = np.zeros(3), np.zeros(3)
    step = np.array([1.0, -2.0, 0.5])
    for k in range(1, 40):
        low_pass(filtered, step, bias, 150.0, 1.0 / rate)
        share = 1.0 - math.exp(-2.0 * math.pi * 150.0 * k / rate)
        np.testing.assert_allclose(filtered, share * step, rtol=1e-12)


def test_ten_short_steps_equal_a_long_one() -> None:
    short, long = np.ones(3), np.ones(3)
    measured, bias = np.array([3.0, 0.0, -1.0]), np.zeros(3)
    for _ in range(10):
        low_pass(short, measured, bias, 40.0, 0.001)
    low_pass(long, measured, bias, 40.0, 0.010)
    np.testing.assert_allclose(short, long, rtol=1e-13)


def test_bias_is_taken_off() -> None:
    filtered = np.zeros(3)
    bias = np.array([0.1, 0.2, -0.3])
    low_pass(filtered, bias + 1.0, bias, 150.0, 1.0)
    np.testing.assert_allclose(filtered, 1.0, rtol=1e-12)
