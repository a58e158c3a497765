"""Conversion of the gyroscope drift found by the flight process to a calibration record."""

from __future__ import annotations

import math

from quadrotor.calibration_record import CalibrationRecord, Quality
from vehicle.calibration.in_force import GYROSCOPE
from vehicle.mailbox import GyroscopeFound

ERROR_MAX = 0.03
"""deg/s, largest standard error of the mean."""
UNIT = "°/s"
DRIFT = "drift "
AXES = ("x", "y", "z")


def gyroscope_record(found: GyroscopeFound) -> CalibrationRecord:
    """Return the record of an accepted gyroscope calibration."""
    bias = [math.degrees(value) for value in found.bias_b]
    deviation = [math.degrees(value) for value in found.deviation_b]
    error = max(deviation) / math.sqrt(found.samples)
    deviation_max = math.degrees(found.deviation_max)
    return CalibrationRecord(
        name=GYROSCOPE,
        figures=tuple(
            Quality(name=f"{DRIFT}{axis}", value=value, unit=UNIT)
            for axis, value in zip(AXES, bias, strict=True)
        ),
        quality=(
            Quality(name="standard error", value=error, unit=UNIT, limit=ERROR_MAX),
            Quality(
                name="noise per sample (1σ)", value=max(deviation), unit=UNIT, limit=deviation_max
            ),
        ),
        residuals=tuple(
            (f"{axis}, {UNIT}", value) for axis, value in zip(AXES, deviation, strict=True)
        ),
        conditions={
            "samples": str(found.samples),
            "duration": f"{found.seconds:.2f} s",
            "battery": f"{found.voltage:.1f} V",
        },
        requester=found.requester,
        stamp_ns=found.stamp_ns,
    )


def drift_of(record: CalibrationRecord) -> dict[str, float]:
    """Return the drift by axis, in deg/s, rounded far below the sensor's resolution."""
    return {
        figure.name: round(figure.value, 6)
        for figure in record.figures
        if figure.name.startswith(DRIFT)
    }
