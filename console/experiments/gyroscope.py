"""The gyroscope's drift, measured again while the vehicle is at rest (Sec. 5.1)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from console.evaluation.log_columns import read_columns
from console.evaluation.verdict import judged
from console.experiments.client import Client, Result
from console.experiments.manoeuvres import wait_ready
from console.experiments.readings import Progress
from flight_log.fields import MOTOR_REFERENCES, RATE
from quadrotor.calibration_record import CalibrationRecord, Quality
from quadrotor.errors import MeasurementError, RefusedError
from quadrotor.parameters import Parameters, parameter
from quadrotor.records import Array

SAMPLES = "safety.gyro_samples"
CHECK = 5.0
"""Seconds of rest afterwards, in which the remaining drift is measured."""
ERROR_MAX = 0.03
"""Limit of the remaining drift, deg/s."""
KEEP_STILL = "Leave the vehicle standing still; do not touch it"


class GyroscopeOptions(Parameters):
    """Options: the duration of the measurement."""

    samples: int = parameter(500, ge=50, le=5000, step=50)
    """still samples averaged (Sec. 5.1)"""


class Gyroscope:
    """Measures the gyroscope's bias at rest, then checks the remaining bias."""

    name = "gyroscope"

    def __init__(self, vehicle: str = "quad1") -> None:
        self.parameters = GyroscopeOptions()
        self._vehicle = vehicle
        self._found: CalibrationRecord | None = None
        self._window = (0.0, 0.0)

    @property
    def planned(self) -> float:
        return 5.0 + CHECK + self.parameters.samples / 500.0

    def check(self) -> None:
        """Accept all options: every combination is valid."""

    def fly(self, client: Client) -> None:
        """Calibrate. Raises RefusedError with the vehicle's reason: it moved, or motors are on."""
        wait_ready(client)
        client.tell(Progress(KEEP_STILL, 1, 2))
        before = client.parameter(SAMPLES)
        client.change({SAMPLES: self.parameters.samples})
        try:
            self._found = client.calibrate_gyroscope()
        finally:
            client.change({SAMPLES: before})
        start = client.view().time
        while (done := client.view().time - start) < CHECK:
            if client.view().mode != "ready":
                raise RefusedError(
                    f"the vehicle is {client.view().mode}; motors stay off while the gyroscope is "
                    "calibrated. Begin again"
                )
            client.tell(Progress(KEEP_STILL, 2, 2, share=done / CHECK))
            client.wait(0.1)
        self._window = (start, client.view().time)

    def evaluate(self, log: Path) -> Result:
        """Judge the remaining drift. Raises LogFormatError, MeasurementError."""
        found, rates = self._checked(log)
        left = np.degrees(np.abs(rates.mean(axis=0)).max())
        metrics = {
            "standard_error_deg_s": (error := _figure(found, "standard error")),
            "drift_left_deg_s": float(left),
            "deviation_deg_s": float(np.degrees(rates.std(axis=0).max())),
            "samples": float(len(rates)),
        }
        # The remaining drift is measured with an error of its own, as the drift taken off was.
        seen = metrics["deviation_deg_s"] / len(rates) ** 0.5
        limits = {
            "standard_error_deg_s": ERROR_MAX,
            "drift_left_deg_s": max(2.0 * (ERROR_MAX + seen), 4.0 * float(np.hypot(error, seen))),
        }
        return judged(metrics, limits)

    def proposal(self, log: Path) -> CalibrationRecord:
        """Return the drift that the vehicle found and already uses, with the remaining drift."""
        found, _ = self._checked(log)
        result = self.evaluate(log)
        left = Quality(
            name="drift left",
            value=result.metrics["drift_left_deg_s"],
            unit="°/s",
            limit=result.limits["drift_left_deg_s"],
        )
        error = Quality(
            name="standard error",
            value=result.metrics["standard_error_deg_s"],
            unit="°/s",
            limit=ERROR_MAX,
        )
        others = tuple(one for one in found.quality if one.name != "standard error")
        return found.model_copy(update={"quality": (error, left, *others)})

    def _checked(self, log: Path) -> tuple[CalibrationRecord, Array]:
        """Return the record, and the subsequent rates (N, 3), rad/s."""
        if self._found is None:
            raise MeasurementError("the gyroscope was not calibrated, so nothing is proposed")
        columns = read_columns(log, self._vehicle, {"imu": RATE, "actuators": MOTOR_REFERENCES})
        rates = columns["imu"].table(RATE, *self._window)
        if len(rates) < 50:
            raise MeasurementError(
                f"{log.name} has {len(rates)} samples after the calibration, 50 are needed; "
                "was it recorded to its end?"
            )
        if columns["actuators"].table(MOTOR_REFERENCES, *self._window).any():
            raise MeasurementError("motors were on after the gyroscope's calibration; begin again")
        return self._found, rates


def _figure(record: CalibrationRecord, name: str) -> float:
    """Return the quality of this name in a record, NaN when it has none."""
    return next((one.value for one in record.quality if one.name == name), float("nan"))
