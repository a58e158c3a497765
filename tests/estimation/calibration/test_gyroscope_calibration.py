"""Sec. 5.1: the mean of still samples, or the reason for a refusal."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from estimation.calibration.gyroscope import identify_gyroscope
from quadrotor.errors import MeasurementError
from tests.support.arrays import Array

LIMIT = math.radians(1.0)
DRIFT = np.radians([1.2, -0.7, 0.4])


def still(rng: np.random.Generator, count: int = 500, noise: float = 0.3) -> Array:
    return np.asarray(DRIFT + np.radians(noise) * rng.standard_normal((count, 3)))


def test_500_still_samples_give_the_drift_to_three_hundredths_of_a_degree_a_second(
    rng: np.random.Generator,
) -> None:
    found = identify_gyroscope(still(rng), LIMIT)
    assert np.degrees(np.abs(found.bias_b - DRIFT)).max() < 0.03
    assert np.degrees(found.error_b) == pytest.approx(0.3 / math.sqrt(500), rel=0.15)
    assert found.samples == 500


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda s: s + np.linspace(0, 0.2, len(s))[:, None], "standard deviation.*allowed 1.00"),
        (lambda s: s[:20], "20 samples, needed are 50"),
        (lambda s: np.where(np.arange(len(s))[:, None] == 7, np.nan, s), "standard deviation nan"),
    ],
)
def test_what_was_not_still_is_refused(
    rng: np.random.Generator, spoil: Callable[[Array], Array], said: str
) -> None:
    with pytest.raises(MeasurementError, match=said):
        identify_gyroscope(spoil(still(rng)), LIMIT)


def test_running_motors_are_a_reason_to_refuse(rng: np.random.Generator) -> None:
    with pytest.raises(MeasurementError, match=r"motors are on.*disarm"):
        identify_gyroscope(still(rng), LIMIT, motors_on=True)
