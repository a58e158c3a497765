"""The delay of a tracker's poses and the pose of the tracked body on the IMU, identified together.

With the attitudes of `attitude_fit` the positions are linear in all other unknowns: lever arm,
accelerometer bias and gravity, and a position and velocity for each segment.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from estimation.calibration.attitude_fit import ROUNDS, AttitudeFit, fit_attitudes, rows_at, summed
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
from quadrotor.plain_rotations import matrices_of
from quadrotor.records import Array
from quadrotor.vehicle_model import GRAVITY

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
    m = motion
    delay, turn = coarse_fit(m.time, m.rate, m.pose_time, m.quaternion_wt)
    told = told_misfit(turn, m)
    if told:
        raise MeasurementError(told)
    fit = fit_attitudes(m.time, m.rate, m.pose_time, m.quaternion_wt, delay, turn.matrix)
    lever = _lever(m, fit)
    across = lever.values[6:8]
    return TrackedBody(
        delay=fit.delay,
        delay_deviation=float(fit.deviations[0]),
        drift=fit.drift,
        drift_deviation=float(fit.deviations[1]),
        matrix_bt=fit.mount.as_matrix(),
        turn_deviation=fit.turn_deviation,
        lever_b=lever.values[:3],
        lever_deviation=float(lever.deviations[:3].max()),
        world_tilt=float(np.hypot(*across) / GRAVITY),
        attitude_rms=fit.rms,
        position_rms=lever.rms,
        seconds=fit.seconds,
        parts=fit.segment_rms,
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
            f"the vehicle hardly turns ({math.degrees(turning):.1f} °/s rms, needed are "
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
        f"the tracked body turns as the gyroscope, but gravity is {math.degrees(tilt):.0f}° off "
        "the tracker's z: its world is not z up, or mirrored; set z up in the tracking system"
    )


def _lever(m: Motion, attitudes: AttitudeFit) -> SegmentedFit:
    """Return the fit of lever arm, accelerometer bias and gravity."""
    at, parts, axes = attitudes.at, attitudes.segments, attitudes.turns.as_matrix()
    turns = matrices_of(attitudes.integral)
    speed = summed(m.time, np.einsum("nij,nj->ni", turns, m.force))
    moved = rows_at(at, m.time, summed(m.time, speed))
    biased = rows_at(at, m.time, summed(m.time, summed(m.time, turns)))
    columns, rest = np.zeros((len(at), 3, 8)), np.zeros((len(at), 3))
    bases = []
    for world, rows in zip(attitudes.worlds.as_matrix(), parts, strict=True):
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
