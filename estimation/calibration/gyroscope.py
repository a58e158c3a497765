"""Gyroscope drift: the mean of still samples, refused when they were not still (Sec. 5.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quadrotor.errors import MeasurementError
from quadrotor.records import Array

SAMPLES_MIN = 50
"""Least number of samples to distinguish a turn from noise."""


@dataclass(frozen=True)
class GyroscopeCalibration:
    """A drift and its uncertainty; all in rad/s, body axes."""

    bias_b: Array  # (3,)
    deviation_b: Array  # (3,), of one sample
    samples: int

    @property
    def error_b(self) -> Array:
        """Return the standard error (3,) of the bias."""
        error: Array = self.deviation_b / np.sqrt(self.samples)
        return error


def identify_gyroscope(
    angular_velocity_b: Array, deviation_max: float, *, motors_on: bool = False
) -> GyroscopeCalibration:
    """Identify the drift from (N, 3) uncorrected samples in rad/s.

    Args:
        deviation_max: rad/s, largest standard deviation on any axis.

    Raises MeasurementError when motors run, or the samples are too few or not still.
    """
    if motors_on:
        raise MeasurementError(
            "gyroscope not calibrated: motors are on, and their vibration would be taken for "
            "drift; disarm, then try again"
        )
    count = len(angular_velocity_b)
    if count < SAMPLES_MIN:
        raise MeasurementError(
            f"gyroscope not calibrated: {count} samples, needed are {SAMPLES_MIN}; "
            "keep the vehicle still for longer"
        )
    deviation = angular_velocity_b.std(axis=0)
    if not np.isfinite(deviation).all() or deviation.max() > deviation_max:
        raise MeasurementError(
            "gyroscope not calibrated: standard deviation "
            f"{np.degrees(deviation.max()):.2f} °/s, "
            f"allowed {np.degrees(deviation_max):.2f}; keep the vehicle still"
        )
    return GyroscopeCalibration(angular_velocity_b.mean(axis=0), deviation, count)
