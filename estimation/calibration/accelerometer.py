"""Matrix T and bias b of the accelerometer from poses held still (Sec. 5.2 of the paper).

At rest T a_m - T b = g R^T z = g up_b: linear in T and T b, solved by least squares. Four poses in
different directions determine it; the condition number of [a_m^T, -1] shows how well (5.7 for six
faces, 141 for poses within 30 deg, which multiply the noise by as much).

A wrong attitude turns g up_b but keeps its length: along it the equation is as good as the sensor,
across it only as good as the attitude. With corresponding weights, twelve poses within 70 deg leave
0.6 of the error of the paper's plain least squares.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimation.calibration.still_poses import StillPose
from quadrotor.constants import GRAVITY
from quadrotor.errors import DegenerateGeometryError, MeasurementError
from quadrotor.records import Array

POSES_MIN = 4
CONDITION_MAX = 120.0
RANK_TOLERANCE = 1e-3
"""Smallest ratio of the smallest to the largest singular value; below it the poses lie in one
plane."""
FORCE_ERROR = 0.01
"""Error of a pose's mean in m/s^2: the remainder of noise and quantisation."""
FACES = {
    "upright": (0.0, 0.0, 1.0),
    "upside down": (0.0, 0.0, -1.0),
    "nose up": (1.0, 0.0, 0.0),
    "nose down": (-1.0, 0.0, 0.0),
    "left side up": (0.0, 1.0, 0.0),
    "right side up": (0.0, -1.0, 0.0),
}
"""World z in body axes (x forward, y left, z up) of the vehicle's six faces."""
FACE_COSINE = 0.9
"""Cosine for a pose to count as a face: within 26 deg."""


@dataclass(frozen=True)
class AccelerometerCalibration:
    """The calibration f_b = T (a_m - b), with figures of its quality."""

    matrix: Array  # T (3, 3)
    bias: Array  # b (3,), m/s^2, sensor axes
    residuals: Array  # (N, 3) m/s^2, body axes: T (a_m - b) - g up_b of each pose
    condition_number: float
    measured: Array  # (N, 3) m/s^2
    up_b: Array  # (N, 3) unit

    @property
    def rms(self) -> float:
        """Return the rms of a pose's residual, m/s^2."""
        return float(np.sqrt(np.square(self.residuals).sum(axis=1).mean()))


@dataclass(frozen=True)
class Coverage:
    """The coverage of the poses so far: how well they determine the result.

    Attributes:
        next_face: the face whose pose would help most; empty when the poses suffice.
    """

    rank: int
    condition_number: float
    next_face: str


def coverage(measured: Array) -> Coverage:
    """Return the coverage of the poses (N, 3) in m/s^2; N may be 0."""
    rank, condition = _condition(measured)
    missing = len(measured) < POSES_MIN or rank < 4 or condition > CONDITION_MAX
    return Coverage(rank, condition, _best_face(measured) if missing else "")


def face_of(measured: Array) -> str:
    """Return the face whose up is nearest to a still accelerometer's reading (3,).

    Raises MeasurementError when the vehicle rests on none of the six.
    """
    direction = measured / np.linalg.norm(measured)
    name = max(FACES, key=lambda face: float(direction @ np.array(FACES[face])))
    cosine = float(direction @ np.array(FACES[name]))
    if cosine < FACE_COSINE:
        tilt = np.degrees(np.arccos(cosine))
        raise MeasurementError(
            f"pose is {tilt:.0f}° from '{name}', the nearest of the six faces; allowed are "
            f"{np.degrees(np.arccos(FACE_COSINE)):.0f}°. Put it flat on a face, or use a tracker"
        )
    return name


def identify_accelerometer(
    poses: Sequence[StillPose], *, attitude_error: float = math.radians(0.2)
) -> AccelerometerCalibration:
    """Identify T and b; a pose without an attitude from a tracker uses that of its face.

    Args:
        attitude_error: rad, standard deviation of the attitudes.

    Raises MeasurementError for too few poses or one on no face, DegenerateGeometryError for poses
    that do not determine the result; both name the missing pose.
    """
    measured = np.array([pose.measured for pose in poses]).reshape(-1, 3)
    state = coverage(measured)
    if len(poses) < POSES_MIN:
        raise MeasurementError(
            f"{len(poses)} poses, needed are {POSES_MIN} or more in different directions; "
            f"next: {state.next_face}"
        )
    if state.rank < 4:
        raise DegenerateGeometryError(
            f"the {len(poses)} poses have rank {state.rank} of 4: turned about one axis only, they "
            f"leave T undetermined; next: {state.next_face}"
        )
    if state.condition_number > CONDITION_MAX:
        raise DegenerateGeometryError(
            f"the {len(poses)} poses have the condition number {state.condition_number:.0f}, "
            f"allowed {CONDITION_MAX:.0f}: too near to each other; next: {state.next_face}"
        )
    ups = np.array([_up_of(pose) for pose in poses])
    matrix, product = _solve(measured, ups, GRAVITY * attitude_error)
    bias = np.asarray(np.linalg.solve(matrix, product), dtype=np.float64)
    residuals: Array = (measured - bias) @ matrix.T - GRAVITY * ups
    return AccelerometerCalibration(matrix, bias, residuals, state.condition_number, measured, ups)


def _solve(measured: Array, ups: Array, across: float) -> tuple[Array, Array]:
    """Solve the weighted equations for T and T b; `across` is their error across up in m/s^2."""
    system, rows, right = _system(measured), [], []
    for row, up in zip(system, ups, strict=True):
        along = np.outer(up, up)
        weight = along / FORCE_ERROR + (np.eye(3) - along) / max(across, FORCE_ERROR)
        rows.append(np.kron(weight, row))  # the rows of [T, T b] one after the other
        right.append(weight @ (GRAVITY * up))
    solution, *_ = np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)
    found = np.asarray(solution, dtype=np.float64).reshape(3, 4)
    return found[:, :3].copy(), found[:, 3].copy()


def _up_of(pose: StillPose) -> Array:
    if pose.up_b is not None:
        return pose.up_b
    return np.array(FACES[face_of(pose.measured)])


def _system(measured: Array) -> Array:
    return np.column_stack([measured, -np.ones(len(measured))])


def _condition(measured: Array) -> tuple[int, float]:
    """Return rank and condition number of [a_m^T, -1], infinite below rank 4."""
    if not len(measured):
        return 0, float("inf")
    values = np.linalg.svd(_system(measured), compute_uv=False)
    rank = int((values > RANK_TOLERANCE * values[0]).sum())
    return rank, float(values[0] / values[3]) if rank == 4 else float("inf")


def _best_face(measured: Array) -> str:
    """Return the face that, when added, leaves the least uncertainty."""

    def smallest(face: str) -> tuple[float, ...]:
        added = np.vstack([measured, GRAVITY * np.array(FACES[face])])
        values = np.linalg.svd(_system(added), compute_uv=False)
        # The rank first (poses before the fourth), then the weakest direction.
        return tuple(np.round(np.flip(np.pad(values, (0, 4 - len(values)))), 9))

    return max(FACES, key=smallest)
