"""Delay, mounting and gyroscope bias with which a gyroscope turns as a tracker's attitudes do.

The gyroscope is integrated over short segments, each with its own start, so that its noise and bias
do not accumulate. In each segment the tracker's attitudes, corrected for delay and mounting, differ
from the integral by one constant turn; any remaining change determines the delay, its drift, the
mounting and the bias, by least squares.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from estimation.calibration.motion import interpolated
from estimation.calibration.segmented_fit import solve_segments
from quadrotor.errors import MeasurementError
from quadrotor.plain_rotations import matrices_of, product_of
from quadrotor.records import Array

SEGMENT = 1.0
"""Length of a segment, s."""
POSES_MIN = 8
"""Minimum number of poses in a segment."""
SEGMENTS_MIN = 5
ROUNDS = 8
PRIOR = (0.2, 0.01, 1.0, 1.0, 1.0, 0.1, 0.1, 0.1)
"""Prior deviations of delay (s), drift, mounting (rad) and gyroscope bias (rad/s)."""


@dataclass(frozen=True)
class AttitudeFit:
    """The delay, mounting and gyroscope bias with which integrated angular velocities are the
    tracker's attitudes.
    """

    delay: float  # s, in the middle of the log
    drift: float  # s/s, of the delay
    mount: Any  # Rotation from the tracked body to the vehicle's body
    bias_b: Array  # (3,) rad/s
    deviations: Array  # (8,) of delay, drift, mount (rad) and bias
    rms: float  # rad, of the residuals
    at: Array  # (M,) s, stamps of the poses on the gyroscope's clock
    segments: list[Any]  # rows of the poses in each segment
    segment_rms: Array  # (S,) rad
    worlds: Any  # Rotations of the segments, from the integral's start to the tracker's world
    integral: Array  # (N, 4), attitude since the first sample
    turns: Any  # Rotations of the integral at the poses

    @property
    def turn_deviation(self) -> float:
        """Return the standard deviation of the mounting about its worst axis, rad."""
        return float(self.deviations[2:5].max())

    @property
    def seconds(self) -> float:
        return float(sum(self.at[rows[-1]] - self.at[rows[0]] for rows in self.segments))


def fit_attitudes(
    time: Array, rate: Array, pose_time: Array, quaternion_wt: Array, delay: float, matrix_bt: Array
) -> AttitudeFit:
    """Fit delay, drift, mounting and gyroscope bias together, from a delay (s) and a mounting
    that are nearly right. Raises MeasurementError when too few poses overlap with the gyroscope.
    """
    from scipy.spatial.transform import Rotation

    mount, bias, drift = Rotation.from_matrix(matrix_bt), np.zeros(3), 0.0
    seen = Rotation.from_quat(quaternion_wt[:, [1, 2, 3, 0]])
    since = pose_time - 0.5 * (pose_time[0] + pose_time[-1])
    weights: Array | None = None
    for _ in range(ROUNDS):
        at = pose_time - delay - drift * since
        parts = _segments(at, time)
        integral = _integrated(time, rate - bias)
        turns, rates = _turned_at(at, time, integral, rate - bias)
        away = seen * mount.inv() * turns.inv()
        means = {k: away[rows].mean() for k, rows in enumerate(parts)}
        rest = np.zeros((len(at), 3))
        for k, rows in enumerate(parts):
            rest[rows] = (means[k].inv() * away[rows]).as_rotvec()
        axes = turns.as_matrix()
        late = np.einsum("nij,nj->ni", axes, rates)[..., None]
        drifted = rows_at(at, time, summed(time, matrices_of(integral)))
        columns = np.concatenate([late, late * since[:, None, None], -axes, drifted], axis=2)
        bases = [np.ones((len(rows), 1)) for rows in parts]
        fit = solve_segments(columns, rest, parts, bases, PRIOR, weights)
        step, weights = fit.values, fit.weights
        delay, drift = delay + step[0], drift + step[1]
        mount, bias = Rotation.from_rotvec(step[2:5]) * mount, bias + step[5:8]
        if np.abs(step[[0, 2, 3, 4]]).max() < 1e-7:
            break
    worlds = Rotation.concatenate([means[k] for k in range(len(parts))])
    return AttitudeFit(
        float(delay),
        float(drift),
        mount=mount,
        bias_b=bias,
        deviations=fit.deviations,
        rms=fit.rms,
        at=at,
        segments=parts,
        segment_rms=fit.parts,
        worlds=worlds,
        integral=integral,
        turns=turns,
    )


def _segments(at: Array, time: Array) -> list[Any]:
    """Return the rows of the poses in each segment, within the IMU's time."""
    number = np.floor((at - at[0]) / SEGMENT).astype(int)
    number[(at < time[0]) | (at > time[-1])] = -1
    parts = [np.flatnonzero(number == k) for k in range(number.max() + 1)]
    found = [rows for rows in parts if len(rows) >= POSES_MIN]
    if len(found) < SEGMENTS_MIN:
        raise MeasurementError(
            f"the tracker saw the vehicle in {len(found)} of {len(parts)} s; keep it in view"
        )
    return found


def _integrated(time: Array, rate: Array) -> Array:
    """Return the attitudes (N, 4) since the first sample, by doubling the span of the products."""
    phi = 0.5 * (rate[1:] + rate[:-1]) * np.diff(time)[:, None]
    half = 0.5 * np.linalg.norm(phi, axis=1, keepdims=True)
    q = np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * phi], axis=1)
    q = np.concatenate([[[1.0, 0.0, 0.0, 0.0]], q])
    reach = 1
    while reach < len(q):
        q = np.concatenate([q[:reach], product_of(q[:-reach], q[reach:])])
        reach *= 2
    found: Array = q / np.linalg.norm(q, axis=1, keepdims=True)
    return found


def _turned_at(at: Array, time: Array, integral: Array, rate: Array) -> tuple[Any, Array]:
    """Return the integral and the angular velocity at times between the samples."""
    from scipy.spatial.transform import Rotation

    k = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    between = interpolated(at, time, rate)
    step = 0.5 * (rate[k] + between) * (at - time[k])[:, None]
    return Rotation.from_quat(integral[k][:, [1, 2, 3, 0]]) * Rotation.from_rotvec(step), between


def summed(time: Array, values: Array) -> Array:
    """Return the integral since the first sample, by trapezoids."""
    step = np.diff(time).reshape(-1, *[1] * (values.ndim - 1))
    parts = 0.5 * (values[1:] + values[:-1]) * step
    return np.concatenate([np.zeros_like(values[:1]), np.cumsum(parts, axis=0)])


def rows_at(at: Array, time: Array, values: Array) -> Array:
    """Return tables (N, …) at other times."""
    flat = interpolated(at, time, values.reshape(len(values), -1))
    return flat.reshape(len(at), *values.shape[1:])
