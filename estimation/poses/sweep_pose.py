"""The pose at which planes of light met a vehicle's sensors: the start of a filter on sweeps.

Levenberg-Marquardt on all angles, from the point where the stations' axes are nearest to each
other, level, at four headings; the best result is used. The planes must have met the vehicle at
nearly one place.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimation.sweep_angles import plane_numbers, swept
from quadrotor.compiled import compiled
from quadrotor.errors import DegenerateGeometryError
from quadrotor.plain_rotations import matrices_of
from quadrotor.records import Array, Record
from quadrotor.vectors import (
    add,
    axes_of,
    cross,
    multiply,
    normalized,
    quaternion,
    to_world,
    turned,
    vector,
)

STEPS = 40
WORST = 5.0
"""Largest rms residual of a pose, in deviations."""
LEAST_KNOWN = 0.5
"""Largest deviation, in m and rad, of a pose that counts as determined."""
YAWS = np.radians([0.0, 90.0, 180.0, 270.0])


class SweepPose(NamedTuple):
    """A pose with the covariance (6, 6) of position (m) and attitude (rad), world axes."""

    position_w: Array
    quaternion_wb: Array
    covariance: Array


def sweep_pose(frames: Sequence[Record], plane_sigma: float = 0.0) -> SweepPose:
    """Return the pose that fits SWEEPS_SAMPLE items, one per plane, whose angles have an error in
    common of `plane_sigma` (rad).

    Raises DegenerateGeometryError when they leave it open or contradict each other.
    """
    if len({tuple(frame["plane"]["origin_w"]) for frame in frames}) < 2:
        raise DegenerateGeometryError("they are of one base station, and two determine a pose")
    first = _first_guess([frame["plane"] for frame in frames])
    stacked, planes = np.array(frames), np.array([plane_numbers(one) for one in frames])
    best = min(
        (
            _fit(stacked, planes, plane_sigma, first, np.array([np.cos(half), 0, 0, np.sin(half)]))
            for half in 0.5 * YAWS
        ),
        key=lambda one: one[0],
    )
    cost, position, attitude, normal = best
    numbers = int(sum(frame["count"] for frame in frames))
    if numbers < 6 or not np.linalg.cond(normal) < 1e12:
        raise DegenerateGeometryError(f"{numbers} sweep angles leave the pose open")
    covariance = np.asarray(np.linalg.inv(normal), np.float64)
    if not (np.sqrt(np.diag(covariance)) < LEAST_KNOWN).all():
        raise DegenerateGeometryError(f"the sweeps of {len(frames)} planes leave the pose open")
    if not cost < numbers * WORST**2:
        raise DegenerateGeometryError(
            f"no pose fits the sweeps: the best is {np.sqrt(cost / numbers):.0f} deviations off, "
            f"allowed {WORST:g}; are the base stations where the geometry file says?"
        )
    return SweepPose(position, attitude, covariance)


def _first_guess(planes: Sequence[Record]) -> Array:
    """Return the point nearest to the axes of the stations, each its x."""
    left, right = np.zeros((3, 3)), np.zeros(3)
    for plane in planes:
        axis = matrices_of(plane["quaternion_wr"][None])[0, :, 0]
        across = np.eye(3) - np.outer(axis, axis)
        left += across
        right += across @ plane["origin_w"]
    return np.asarray(np.linalg.lstsq(left, right, rcond=None)[0], np.float64)


def _fit(
    frames: Record, planes: Array, plane_sigma: float, position: Array, attitude: Array
) -> tuple[float, Array, Array, Array]:
    """Return squared residuals (in variances), pose and normal matrix (6, 6) of a local fit."""
    damping = 1e-3
    cost, normal, pull = _system(frames, planes, plane_sigma, position, attitude)
    for _ in range(STEPS):
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-9), pull)
        moved = position + step[:3]
        phi = turned((1.0, 0.0, 0.0, 0.0), (step[3], step[4], step[5]))
        w, x, y, z = attitude
        other = np.array(normalized(multiply(phi, (w, x, y, z))))
        trial = _system(frames, planes, plane_sigma, moved, other)
        if trial[0] < cost:
            gained = cost - trial[0]
            position, attitude, damping = moved, other, damping / 3.0
            cost, normal, pull = trial
            if gained < 1e-3:
                break
        else:
            damping *= 5.0
    return cost, position, attitude, normal


@compiled
def _system(
    frames: Record, planes: Array, plane_sigma: float, position: Array, attitude: Array
) -> tuple[float, Array, Array]:
    """Return squared residuals (in variances), normal matrix (6, 6) and right side (6,).

    Args:
        frames: SWEEPS_SAMPLE (N,).
        planes: (N, 12), their numbers.
        plane_sigma: rad, deviation common to the angles of a plane.
    """
    cost, normal, pull, row = 0.0, np.zeros((6, 6)), np.zeros(6), np.zeros(6)
    row_sum = np.zeros(6)
    axes = axes_of(quaternion(attitude))
    for n in range(len(frames)):
        row_sum[:] = 0.0
        rest_sum = 0.0
        for k in range(frames[n].count):
            lever = to_world(axes, vector(frames[n].sensor_b[k]))
            predicted, gradient = swept(planes[n], add(vector(position), lever))
            rest = np.remainder(frames[n].angle[k] - predicted + math.pi, math.tau) - math.pi
            if not math.isfinite(rest):
                return math.inf, normal, pull
            turning = cross(lever, gradient)
            for i in range(3):
                row[i], row[3 + i] = gradient[i] / frames[n].sigma, turning[i] / frames[n].sigma
            rest /= frames[n].sigma
            cost += rest * rest
            normal += np.outer(row, row)
            pull += rest * row
            row_sum += row
            rest_sum += rest
        # The inverse of a covariance with a common part weighs the sum less.
        ratio = (plane_sigma / frames[n].sigma) ** 2
        less = ratio / (1.0 + frames[n].count * ratio)
        cost -= less * rest_sum * rest_sum
        normal -= less * np.outer(row_sum, row_sum)
        pull -= less * rest_sum * row_sum
    return cost, normal, pull
