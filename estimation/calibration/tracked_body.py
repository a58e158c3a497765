"""The delay of a tracker's poses and the pose of the tracked body on the IMU, identified together.

The gyroscope is integrated over short segments, each with its own start, so that its noise and bias
do not accumulate. In each segment the tracker's attitudes, corrected for delay and mounting, differ
from the integral by one constant turn; any remaining change determines the delay, its drift, the
mounting and the bias, by least squares. With these attitudes the positions are linear in all other
unknowns: lever arm, accelerometer bias and gravity, and a position and velocity for each segment.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from estimation.calibration.motion import (
    STEP,
    Turn,
    angular_velocity,
    best_lag,
    best_turn,
    common_grid,
    interpolated,
    on_grid,
)
from estimation.calibration.segmented_fit import SegmentedFit, solve_segments
from quadrotor.errors import MeasurementError
from quadrotor.plain_rotations import matrices_of, product_of
from quadrotor.records import Array
from quadrotor.vehicle_model import GRAVITY

SEGMENT = 1.0
"""Length of a segment, s."""
POSES_MIN = 8
"""Minimum number of poses in a segment."""
SHORTEST = 10.0
"""Shortest overlap of both signals, s."""
STILL = 0.05
"""Slowest rms angular velocity, rad/s: slower turning is lost in the tracker's noise."""
FITS = 0.6
"""Smallest share of the gyroscope's turning that the tracker's must explain."""
TILTED = math.radians(30.0)
"""Largest angle in rad between the tracker's z and gravity: no laboratory's floor is
more tilted."""
DELAY_MAX = 0.2
"""Largest delay, s."""
ROUNDS = 8
ATTITUDE_PRIOR = (0.2, 0.01, 1.0, 1.0, 1.0, 0.1, 0.1, 0.1)
"""Prior deviations of delay (s), drift, mounting (rad) and gyroscope bias (rad/s)."""
POSITION_PRIOR = (1.0, 1.0, 1.0, 0.5, 0.5, 0.5, 0.5, 0.5)
"""Prior deviations of lever arm (m), accelerometer bias and gravity across the tracker's z
(m/s^2)."""


@dataclass(frozen=True)
class Motion:
    """The IMU in body axes by its stamps (s), and the tracker's poses by theirs."""

    time: Array  # (N,)
    force: Array  # (N, 3) m/s^2
    rate: Array  # (N, 3) rad/s
    pose_time: Array  # (M,)
    position_w: Array  # (M, 3)
    quaternion_wt: Array  # (M, 4)


@dataclass(frozen=True)
class TrackedBody:
    """The pose of the tracked body on the vehicle, and the delay of its poses.

    Each deviation is a standard deviation that allows for noise correlated within a segment.
    """

    delay: float  # s, in the middle of the log
    delay_deviation: float
    drift: float  # s/s, of the delay
    drift_deviation: float
    matrix_bt: Array  # (3, 3), tracked body to vehicle's body
    turn_deviation: float  # rad, of the worst axis
    lever_b: Array  # (3,) m, of the tracked body's origin
    lever_deviation: float  # m, of the worst axis
    world_tilt: float  # rad, between the tracker's z and gravity
    attitude_rms: float  # rad, of the residuals
    position_rms: float  # m
    seconds: float
    parts: Array  # (S,) rad, rms of the attitudes' residuals in each segment


def identify_tracked_body(motion: Motion) -> TrackedBody:
    """Identify delay, mounting and lever arm. Raises MeasurementError with what is missing."""
    from scipy.spatial.transform import Rotation

    m = motion
    delay, turn = coarse_fit(m.time, m.rate, m.pose_time, m.quaternion_wt)
    told = told_misfit(turn, m)
    if told:
        raise MeasurementError(told)
    mount, bias, drift = Rotation.from_matrix(turn.matrix), np.zeros(3), 0.0
    seen = Rotation.from_quat(m.quaternion_wt[:, [1, 2, 3, 0]])
    since = m.pose_time - 0.5 * (m.pose_time[0] + m.pose_time[-1])
    weights: Array | None = None
    for _ in range(ROUNDS):
        at = m.pose_time - delay - drift * since
        parts = _segments(at, m.time)
        integral = _integrated(m.time, m.rate - bias)
        turns, rates = _turned_at(at, m.time, integral, m.rate - bias)
        away = seen * mount.inv() * turns.inv()
        means = {k: away[rows].mean() for k, rows in enumerate(parts)}
        rest = np.zeros((len(at), 3))
        for k, rows in enumerate(parts):
            rest[rows] = (means[k].inv() * away[rows]).as_rotvec()
        axes = turns.as_matrix()
        late = np.einsum("nij,nj->ni", axes, rates)[..., None]
        summed = _rows_at(at, m.time, _summed(m.time, matrices_of(integral)))
        columns = np.concatenate([late, late * since[:, None, None], -axes, summed], axis=2)
        bases = [np.ones((len(rows), 1)) for rows in parts]
        fit = solve_segments(columns, rest, parts, bases, ATTITUDE_PRIOR, weights)
        step, weights = fit.values, fit.weights
        delay, drift = delay + step[0], drift + step[1]
        mount, bias = Rotation.from_rotvec(step[2:5]) * mount, bias + step[5:8]
        if np.abs(step[[0, 2, 3, 4]]).max() < 1e-7:
            break
    worlds = Rotation.concatenate([means[k] for k in range(len(parts))])
    lever = _lever(m, at, parts, worlds.as_matrix(), integral, axes)
    across = lever.values[6:8]
    return TrackedBody(
        delay=float(delay),
        delay_deviation=float(fit.deviations[0]),
        drift=float(drift),
        drift_deviation=float(fit.deviations[1]),
        matrix_bt=mount.as_matrix(),
        turn_deviation=float(fit.deviations[2:5].max()),
        lever_b=lever.values[:3],
        lever_deviation=float(lever.deviations[:3].max()),
        world_tilt=float(np.hypot(*across) / GRAVITY),
        attitude_rms=fit.rms,
        position_rms=lever.rms,
        seconds=float(sum(at[rows[-1]] - at[rows[0]] for rows in parts)),
        parts=fit.parts,
    )


def coarse_fit(
    time: Array, rate: Array, pose_time: Array, quaternion_wt: Array
) -> tuple[float, Turn]:
    """Return the delay (s), to a hundredth of a second, and the turn from the tracker's angular
    velocity to the gyroscope's. Raises MeasurementError for too little motion.
    """
    if len(pose_time) < 2 or len(time) < 2:
        raise MeasurementError("there are no poses of the tracker next to the IMU; is it running?")
    grid = common_grid(time, pose_time)
    if len(grid) * STEP < SHORTEST:
        raise MeasurementError(
            f"IMU and tracker have {max(0.0, len(grid) * STEP):.1f} s in common, needed are "
            f"{SHORTEST:g} s; record for longer, with the vehicle in the tracker's view"
        )
    gyro = on_grid(grid, time, rate)
    turning = float(np.sqrt(((gyro - np.median(gyro, axis=0)) ** 2).sum(axis=1).mean()))
    if turning < STILL:
        raise MeasurementError(
            f"the vehicle hardly turns ({math.degrees(turning):.1f} deg/s rms, needed are "
            f"{math.degrees(STILL):.1f}): turn it about all three axes, then begin again"
        )
    seen = on_grid(grid, pose_time, angular_velocity(pose_time, quaternion_wt))
    turns, seen_turns = (np.linalg.norm(one, axis=1, keepdims=True) for one in (gyro, seen))
    shift, _ = best_lag(turns, seen_turns, round(DELAY_MAX / STEP))
    late = interpolated(grid + shift * STEP, grid, seen)
    return shift * STEP, best_turn(late, gyro)


def told_misfit(turn: Turn, motion: Motion) -> str:
    """Return why the attitudes are not those of a body fixed to the IMU; empty when they are."""
    m = motion
    if turn.explained < FITS:
        return (
            f"the gyroscope explains {turn.explained:.0%} of the tracked body's turning: it is "
            "mirrored, or another body; define its axes right-handed in the tracking system"
        )
    force = interpolated(m.pose_time, m.time, m.force) @ turn.matrix
    up = np.einsum("nij,nj->ni", matrices_of(m.quaternion_wt), force).mean(axis=0)
    tilt = math.acos(float(up[2] / np.linalg.norm(up)))
    if tilt < TILTED:
        return ""
    return (
        f"the tracked body turns as the gyroscope, but gravity is {math.degrees(tilt):.0f} deg off "
        "the tracker's z: its world is not z up, or mirrored; set z up in the tracking system"
    )


def _lever(
    m: Motion, at: Array, parts: list[Any], worlds: Array, integral: Array, axes: Array
) -> SegmentedFit:
    """Return the fit of lever arm, accelerometer bias and gravity."""
    turns = matrices_of(integral)
    speed = _summed(m.time, np.einsum("nij,nj->ni", turns, m.force))
    moved = _rows_at(at, m.time, _summed(m.time, speed))
    biased = _rows_at(at, m.time, _summed(m.time, _summed(m.time, turns)))
    columns, rest = np.zeros((len(at), 3, 8)), np.zeros((len(at), 3))
    bases = []
    for world, rows in zip(worlds, parts, strict=True):
        since = at[rows] - at[rows].mean()
        columns[rows, :, :3] = -world @ axes[rows]
        columns[rows, :, 3:6] = world @ biased[rows]
        for axis in range(2):
            columns[rows, axis, 6 + axis] = -0.5 * since**2
        rest[rows] = m.position_w[rows] - moved[rows] @ world.T
        rest[rows, 2] += 0.5 * GRAVITY * since**2
        bases.append(np.stack([np.ones(len(rows)), since], axis=1))
    weights = None
    for _ in range(ROUNDS):
        fit = solve_segments(columns, rest, parts, bases, POSITION_PRIOR, weights)
        weights = fit.weights
    return fit


def _segments(at: Array, time: Array) -> list[Any]:
    """Return the rows of the poses in each segment, within the IMU's time."""
    number = np.floor((at - at[0]) / SEGMENT).astype(int)
    number[(at < time[0]) | (at > time[-1])] = -1
    parts = [np.flatnonzero(number == k) for k in range(number.max() + 1)]
    found = [rows for rows in parts if len(rows) >= POSES_MIN]
    if len(found) * SEGMENT < 0.5 * SHORTEST:
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


def _summed(time: Array, values: Array) -> Array:
    """Return the integral since the first sample, by trapezoids."""
    step = np.diff(time).reshape(-1, *[1] * (values.ndim - 1))
    parts = 0.5 * (values[1:] + values[:-1]) * step
    return np.concatenate([np.zeros_like(values[:1]), np.cumsum(parts, axis=0)])


def _rows_at(at: Array, time: Array, values: Array) -> Array:
    """Return tables (N, …) at other times."""
    flat = interpolated(at, time, values.reshape(len(values), -1))
    return flat.reshape(len(at), *values.shape[1:])
