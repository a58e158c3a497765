"""The gyroscope's bias of an imported flight, found at rest as a vehicle finds it at its start."""

from __future__ import annotations

import math

import numpy as np

from estimation.calibration.gyroscope import SAMPLES_MIN, GyroscopeCalibration, identify_gyroscope
from quadrotor.errors import MeasurementError
from quadrotor.records import Record
from vehicle.safety.parameters import SafetyParameters

WINDOW_NS = 1_000_000_000
"""Time in ns of rest from which a bias is found."""
LATEST_NS = 10_000_000_000
"""Time in ns after a log's beginning until which rest is looked for: a hover may be as calm."""
FORCE_DEVIATION_MAX = 0.3
"""m/s², largest standard deviation of the accelerometer on any axis at rest."""


def bias_at_rest(imu: Record) -> GyroscopeCalibration | None:
    """Return the bias in the first second of rest in IMU_SAMPLE (N,); None without rest."""
    allowed = SafetyParameters()
    stamps = imu["stamp_ns"]
    for start in range(int(stamps[0]), int(min(stamps[-1], stamps[0] + LATEST_NS)), WINDOW_NS // 2):
        first, last = np.searchsorted(stamps, (start, start + WINDOW_NS))
        rows = imu[first:last]
        if last == len(stamps) or len(rows) < SAMPLES_MIN:
            continue
        if rows["specific_force_b"].std(axis=0).max() > FORCE_DEVIATION_MAX:
            continue
        try:
            found = identify_gyroscope(
                rows["angular_velocity_b"], math.radians(allowed.gyro_deviation_max)
            )
        except MeasurementError:
            continue  # it moved; later it may rest
        if np.abs(found.bias_b).max() <= math.radians(allowed.gyro_drift_max):
            return found
    return None
