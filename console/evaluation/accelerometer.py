"""The accelerometer's calibration from a log: the held poses and the result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from console.evaluation.log_columns import read_columns
from estimation.calibration.accelerometer import (
    CONDITION_MAX,
    AccelerometerCalibration,
    identify_accelerometer,
)
from estimation.calibration.still_poses import StillPose
from flight_log.fields import FORCE, MOTOR_REFERENCES, TRACKED_ATTITUDE
from flight_log.run import Series
from quadrotor.calibration_record import CalibrationRecord, Quality
from quadrotor.errors import MeasurementError
from quadrotor.parameter_description import ParameterValue
from quadrotor.plain_rotations import rows_of
from quadrotor.records import Array

MATRIX = tuple(f"imu.accelerometer_{row}{column}" for row in "xyz" for column in "xyz")
BIAS = tuple(f"imu.accelerometer_bias_{axis}" for axis in "xyz")
WANTED = {"imu": FORCE, "actuators": MOTOR_REFERENCES, "tracker_pose": TRACKED_ATTITUDE}
SAMPLES_MIN = 20
"""Minimum number of samples of a pose."""
DEVIATION_MAX = 0.15
"""Largest standard deviation, in m/s^2 on any axis, of the samples of a pose; above their noise at
rest."""
SATURATED = 19.4
"""Saturation of the accelerometer, in m/s^2."""
RESIDUAL_MAX = 0.1
"""Largest residual, in m/s^2 rms: three times the effect of 0.2 deg of attitude."""


@dataclass(frozen=True)
class InForce:
    """The calibration that was in force when the log's samples were made."""

    matrix: Array  # T (3, 3)
    bias: Array  # b (3,) m/s^2

    @classmethod
    def of(cls, parameter: Callable[[str], ParameterValue]) -> InForce:
        """Return the calibration by the present values of the vehicle's parameters."""
        entries = [float(parameter(name)) for name in MATRIX]
        bias = [float(parameter(name)) for name in BIAS]
        return cls(np.array(entries).reshape(3, 3), np.array(bias))


@dataclass(frozen=True)
class Held:
    """One held pose: start and end (s, vehicle clock), and the face; empty with a tracker."""

    start: float
    end: float
    face: str


def identify(
    log: Path, vehicle: str, in_force: InForce | None, held: Sequence[Held], noise: float
) -> AccelerometerCalibration:
    """Identify T and b from the poses `held` in the log.

    Args:
        noise: rad, standard deviation of a pose's attitude.

    Raises LogFormatError; MeasurementError for too few poses, one that moved, was saturated, or
    had motors on; DegenerateGeometryError for poses that do not determine the result.
    """
    if in_force is None:
        raise MeasurementError("no pose was held, so there is nothing to calibrate from")
    on_faces = all(one.face for one in held)
    optional = ("tracker_pose",) if on_faces else ()
    columns = read_columns(log, vehicle, WANTED, optional)
    poses = [_pose(number, one, columns, in_force) for number, one in enumerate(held, 1)]
    return identify_accelerometer(poses, attitude_error=noise)


def _pose(number: int, held: Held, columns: dict[str, Series], in_force: InForce) -> StillPose:
    force, references, seen = (
        columns[topic].table(names, held.start, held.end) for topic, names in WANTED.items()
    )
    raw = raw_of(force, in_force.matrix, in_force.bias)
    if len(raw) < SAMPLES_MIN:
        raise MeasurementError(
            f"pose {number} has {len(raw)} samples in the log, at least {SAMPLES_MIN} are needed; "
            "was it recorded to its end?"
        )
    if references.any():
        raise MeasurementError(f"motors were on in pose {number}; begin again with the motors off")
    if np.abs(raw).max() >= SATURATED:
        raise MeasurementError(
            f"the accelerometer is saturated in pose {number}: {np.abs(raw).max():.1f} m/s², "
            f"its range is {SATURATED:g}"
        )
    deviation = float(raw.std(axis=0).max())
    if deviation > DEVIATION_MAX:
        raise MeasurementError(
            f"the vehicle moved in pose {number}: {deviation:.2f} m/s² of deviation, allowed "
            f"{DEVIATION_MAX:g}; begin again"
        )
    up = None
    if not held.face:
        if not len(seen):
            raise MeasurementError(
                f"the log has no poses of the tracker while pose {number} was held; use "
                "experiment.method=faces without a tracker"
            )
        mean = up_of(seen).mean(axis=0)
        up = mean / np.linalg.norm(mean)
    return StillPose(raw.mean(axis=0), up, deviation)


def up_of(quaternion_wb: Array) -> Array:
    """Return world z in body axes of attitudes (…, 4) in w, x, y, z."""
    return np.stack(rows_of(np.moveaxis(quaternion_wb, -1, 0))[2], axis=-1)


def raw_of(specific_force_b: Array, matrix: Array, bias: Array) -> Array:
    """Return the raw readings of the sensor, a_m = T^-1 f + b, for readings (N, 3) calibrated by T
    and b.
    """
    raw: Array = np.linalg.solve(matrix, specific_force_b.T).T + bias
    return raw


def record_of(found: AccelerometerCalibration, conditions: dict[str, str]) -> CalibrationRecord:
    """Return the record that is proposed to the vehicle."""
    values: dict[str, ParameterValue] = dict(
        zip(MATRIX, found.matrix.ravel().tolist(), strict=True)
    )
    values |= dict(zip(BIAS, found.bias.tolist(), strict=True))
    lengths = np.linalg.norm(found.residuals, axis=1)
    return CalibrationRecord(
        name="accelerometer",
        values=values,
        figures=(Quality(name="poses", value=float(len(lengths))),),
        quality=(
            Quality(name="residual rms", value=found.rms, unit="m/s²", limit=RESIDUAL_MAX),
            Quality(name="residual max", value=float(lengths.max()), unit="m/s²"),
            Quality(name="condition number", value=found.condition_number, limit=CONDITION_MAX),
        ),
        residuals=tuple((f"pose {k}, m/s²", float(length)) for k, length in enumerate(lengths, 1)),
        conditions=conditions,
    )
