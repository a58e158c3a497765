"""The steps of a motor bench test from its log: constant references and the measured responses."""

from __future__ import annotations

import numpy as np

from console.reports.run_log import RunLog
from estimation.calibration.motor_bench import BenchSteps, held_steps
from estimation.calibration.motor_law import USABLE, MotorCalibration, identify_motor
from flight_log.fields import MOTOR_REFERENCES
from quadrotor.errors import MeasurementError
from quadrotor.records import Array


def fitted(steps: BenchSteps) -> tuple[dict[str, tuple[Array, Array]], str]:
    """Return the curves of the fits by name, as force and reference, and the results as text."""
    try:
        law = identify_motor(steps)
    except MeasurementError as error:
        return {}, f"No fit: {error}."
    force: Array = np.linspace(0.0, float(steps.force.max()), 200)
    alpha, beta = law.root.coefficients
    a, b, c = law.quadratic.coefficients
    curves = {
        "affine in √force": (force, alpha + beta * np.sqrt(force)),
        "quadratic in force": (force, (a * force + b) * force + c),
    }
    return curves, _words(law)


def signals(log: RunLog) -> tuple[Array, Array, Array, BenchSteps]:
    """Return reference at the ticks, force and torque at the sensor's times, and the steps.

    Raises MeasurementError when no reference was held.
    """
    actuators, sensor = log.topics["actuators"], log.topics["bench_reading"]
    reference = np.nanmax(actuators.rows(MOTOR_REFERENCES), axis=1).astype(np.float64)
    force, torque = sensor.rows(("force", "torque")).astype(np.float64).T
    newest = np.clip(np.searchsorted(actuators.time, sensor.time, side="right") - 1, 0, None)
    turning = (reference[newest] > 0.0) & np.isfinite(force) & np.isfinite(torque)
    steps = held_steps(
        sensor.time[turning], reference[newest][turning], force[turning], torque[turning]
    )
    return reference, force, torque, steps


def law_figures(log: RunLog) -> dict[str, float]:
    """Return the results of the fits by name. Raises MeasurementError."""
    law = identify_motor(signals(log)[-1])
    return {
        "root_law_worst_count": law.root.worst,
        "quadratic_worst_count": law.quadratic.worst,
        "torque_ratio_m": law.torque_ratio,
        "thrust_min_N": law.thrust_min,
        "thrust_max_N": law.thrust_max,
    }


def _words(law: MotorCalibration) -> str:
    return (
        f"f = ({law.slope:.6f} (ref + {law.offset:.2f}))² N has a largest error of "
        f"{law.root.worst:.2f} counts, the quadratic {law.quadratic.worst:.2f}; torque over force "
        f"{law.torque_ratio:.4f} m; {law.thrust_min:.3f} to {law.thrust_max:.2f} N between "
        f"{USABLE[0]:.0f} and {USABLE[1]:.0f} counts."
    )
