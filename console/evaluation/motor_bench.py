"""Motor law, torque ratio and lag from a log of the bench, or from a recorded file."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from console.evaluation.bench_file import BenchRecording
from console.evaluation.log_columns import read_columns
from estimation.calibration.motor_bench import BenchSchedule, BenchSteps, average_steps, held_steps
from estimation.calibration.motor_law import USABLE, MotorCalibration, identify_motor
from estimation.calibration.time_constant import TimeConstant, lag_and_dead_time
from flight_log.fields import MOTOR_REFERENCES
from flight_log.run import Series
from quadrotor.calibration_record import CalibrationRecord, Quality
from quadrotor.errors import MeasurementError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Array

WORST_MAX = 1.0
"""Largest error in counts; a square-root law that is off by more does not describe the motor."""
TORQUE_MISS_MAX = 0.02
"""Largest error of the torque, as a share of the largest torque."""
TIME_CONSTANT_ERROR_MAX = 0.01
WANTED = {
    "bench_reading": ("force", "torque", "speed"),
    "actuators": MOTOR_REFERENCES,
    "battery": ("voltage",),
}


@dataclass(frozen=True)
class Battery:
    """The battery law of the vehicle's model."""

    nominal: float = 15.2  # V
    exponent: float = 0.0

    @classmethod
    def of(cls, parameter: Callable[[str], ParameterValue]) -> Battery:
        """Return the battery by the present values of the vehicle's parameters."""
        return cls(
            float(parameter("model.battery_nominal")), float(parameter("model.battery_exponent"))
        )

    def gain(self, voltage: float) -> float:
        """Return the rotor speed at `voltage` (V) relative to that at the nominal voltage."""
        share = min(1.5, max(0.5, voltage / self.nominal))
        return float(share**self.exponent)


@dataclass(frozen=True)
class BenchResult:
    """The result of a bench run; the law holds at the nominal battery voltage."""

    law: MotorCalibration
    lag: TimeConstant
    dead_time: float  # s, from the reference to the first response of the speed
    slope: float  # sqrt(N) per count, at the nominal voltage
    voltage: float  # V, NaN when unknown
    warnings: tuple[str, ...]


def from_log(
    log: Path, vehicle: str, motor: int, schedule: BenchSchedule, started: float, battery: Battery
) -> BenchResult:
    """Evaluate a bench run from its log; `started` in s of the vehicle's clock.

    Raises LogFormatError, or MeasurementError with what is missing.
    """
    columns = read_columns(log, vehicle, WANTED, ("battery",))
    window = started, started + schedule.duration
    readings, ticks = columns["bench_reading"], columns["actuators"]
    force, torque, speed = readings.table(WANTED["bench_reading"], *window).T
    time = _times(readings, window)
    if not len(time):
        raise MeasurementError(f"{log.name} has no bench_reading while the motor turned")
    steps = average_steps(schedule, time - started, force, torque)
    # The motor's own start is different: the lag is searched from the first rest on.
    turning = started + 0.5 * schedule.rest, window[1]
    references = ticks.table(WANTED["actuators"], *turning)[:, motor - 1]
    voltages = columns["battery"].table(WANTED["battery"], *window)
    voltage = float(voltages.mean()) if len(voltages) else math.nan
    recording = BenchRecording(time, np.empty(0), force, torque, speed)
    return _identify(steps, _times(ticks, turning), references, recording, battery, voltage)


def from_file(recording: BenchRecording) -> BenchResult:
    """Evaluate a bench recording. Raises MeasurementError."""
    steps = held_steps(recording.time, recording.reference, recording.force, recording.torque)
    return _identify(steps, recording.time, recording.reference, recording, Battery(), math.nan)


def _identify(
    steps: BenchSteps,
    time: Array,
    references: Array,
    recording: BenchRecording,
    battery: Battery,
    voltage: float,
) -> BenchResult:
    law = identify_motor(steps)
    with_speed = bool(np.isfinite(recording.speed).all())
    signal = recording.speed if with_speed else recording.force
    lag, dead_time = lag_and_dead_time(
        time, references, recording.time, signal, is_force=not with_speed
    )
    warnings = [lag.warning] if lag.warning else []
    gain = 1.0
    if battery.exponent > 0.0 and math.isnan(voltage):
        warnings.append("the battery's voltage is not known: the law is not that of the nominal")
    elif battery.exponent > 0.0:
        gain = battery.gain(voltage)
    return BenchResult(law, lag, dead_time, law.slope / gain, voltage, tuple(warnings))


def _times(columns: Series, window: tuple[float, float]) -> Array:
    start, end = window
    return columns.time[(columns.time >= start) & (columns.time <= end)]


def record_of(found: BenchResult, conditions: dict[str, str]) -> CalibrationRecord:
    """Return the record that is proposed to the vehicle."""
    law, lag = found.law, found.lag
    low, high = USABLE
    used = law.steps.reference
    fits = (("step", law.root), ("quadratic", law.quadratic))
    if math.isfinite(found.voltage):
        conditions = conditions | {"battery": f"{found.voltage:.1f} V"}
    return CalibrationRecord(
        name="motor",
        values={
            "model.motor_slope": found.slope,
            "model.motor_offset": law.offset,
            "model.torque_ratio": law.torque_ratio,
            "model.motor_time_constant": lag.seconds,
            "model.motor_reference_min": max(low, float(used.min())),
            "model.motor_reference_max": min(high, float(used.max())),
        },
        figures=(
            Quality(name="thrust at the least reference", value=law.thrust_min, unit="N"),
            Quality(name="thrust at the largest reference", value=law.thrust_max, unit="N"),
            Quality(name="dead time", value=found.dead_time, unit="s"),
            *(
                Quality(name=f"quadratic {name}", value=value, unit=unit)
                for name, value, unit in zip(
                    "abc", law.quadratic.coefficients, ("count/N²", "count/N", "count"), strict=True
                )
            ),
        ),
        quality=(
            Quality(name="root law worst", value=law.root.worst, unit="count", limit=WORST_MAX),
            Quality(name="root law rms", value=law.root.rms, unit="count"),
            Quality(name="quadratic worst", value=law.quadratic.worst, unit="count"),
            Quality(name="quadratic rms", value=law.quadratic.rms, unit="count"),
            Quality(name="torque miss", value=law.torque_residual, unit="N m"),
            Quality(
                name="time constant error",
                value=100.0 * lag.error / lag.seconds,
                unit="%",
                limit=100.0 * TIME_CONSTANT_ERROR_MAX,
            ),
        ),
        residuals=tuple(
            (f"{name} {reference:.0f}, count", float(miss))
            for name, fit in fits
            for reference, miss in zip(used, fit.residuals, strict=True)
        ),
        warnings=found.warnings,
        conditions=conditions,
    )
