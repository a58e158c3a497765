"""Gyroscope bias from still samples (Sec. 5.1)."""

from __future__ import annotations

import numpy as np
import pytest

from quadrotor.errors import MeasurementError
from vehicle.calibration.gyroscope import GyroCalibration


def test_the_bias_is_the_mean_of_still_samples() -> None:
    random = np.random.default_rng(7)
    bias = np.array([0.02, -0.01, 0.005])
    samples = bias + random.normal(0.0, 0.005, (200, 3))
    calibration = GyroCalibration(200, np.radians(1.0))
    results = [calibration.add(sample) for sample in samples]
    assert all(result is None for result in results[:-1])
    found = results[-1]
    assert found is not None
    np.testing.assert_allclose(found.bias_b, samples.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(found.deviation_b, samples.std(axis=0), atol=1e-12)


def test_a_moving_vehicle_is_refused_with_both_numbers_and_calibrated_once_still() -> None:
    calibration = GyroCalibration(50, np.radians(1.0))
    swing = 0.1 * np.sin(np.linspace(0, 20, 50))
    for rate in swing[:-1]:
        assert calibration.add(np.array([rate, 0.0, 0.0])) is None
    with pytest.raises(MeasurementError, match=r"4\.\d\d °/s, allowed 1\.00"):
        calibration.add(np.array([swing[-1], 0.0, 0.0]))
    results = [calibration.add(np.array([0.03, 0.0, 0.0])) for _ in range(50)]
    found = results[-1]
    assert found is not None
    np.testing.assert_allclose(found.bias_b, [0.03, 0.0, 0.0], atol=1e-12)


def test_samples_taken_while_motors_run_are_none() -> None:
    calibration = GyroCalibration(50, np.radians(1.0))
    for _ in range(49):
        assert calibration.add(np.zeros(3)) is None
    with pytest.raises(MeasurementError, match="motors are on"):
        calibration.add(np.zeros(3), motors_on=True)
    results = [calibration.add(np.zeros(3)) for _ in range(50)]
    assert all(result is None for result in results[:-1])
    assert results[-1] is not None
