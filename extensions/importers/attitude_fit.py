"""Search for the order and direction of quaternions with which a track's attitudes fit the IMU."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from estimation.calibration.motion import Turn, angular_velocity, best_turn, interpolated, on_grid
from extensions.importers.frames import axes, bodies
from extensions.importers.mapping import ORDERS
from extensions.importers.raw import RawTrack, ordered
from extensions.importers.rows import usual_step
from extensions.importers.trajectory import away_from_gaps
from quadrotor.errors import LogFormatError
from quadrotor.plain_rotations import matrices_of
from quadrotor.records import Array

WAYS = ("body to world", "world to body")
FITS = 0.6
"""Least share of explained rotation, or correlation of accelerations, of matching data."""
STILL = 0.03
"""rad/s rms below which rotation is too slow to judge by."""
GRAVITY = 9.80665
NEARLY = 0.85
"""Share of the best score below which the stated order is wrong."""
ROWS = 3000
"""Largest number of attitudes used to find the direction of gravity."""


@dataclass(frozen=True)
class Fit:
    """Attitudes read in one order, compared with the IMU."""

    order: str
    way: str
    turn: Turn  # from the track's angular velocities to the gyroscope's numbers
    rate: Array  # (N, 3) rad/s, on the track's grid
    upright: float  # share of gravity along z of the world, 0…1

    @property
    def score(self) -> float:
        return self.turn.explained * self.upright


def nearest_body(matrix: Array) -> str:
    """Return the letters of the body axes that a rotation turns most nearly into FLU."""
    return min(bodies(), key=lambda one: angle_between(matrix, axes(one, "")))


def angle_between(one: Array, other: Array) -> float:
    """Return the angle between two rotations, rad."""
    return Turn(one @ other.T, 1.0, 1.0).angle


def fit_order(
    raw: RawTrack,
    grids: tuple[Array, Array],
    imu: tuple[Array, Array, Array],
    lag: Callable[[Array, Array], float],
    offset: float,
) -> tuple[Fit, bool]:
    """Return the fit of the order that the mapping states, or of the best one; and whether the
    motion is enough to judge.

    Args:
        grids: of the IMU and of the track.
        imu: seconds (N,), specific force (N, 3) m/s², gyroscope (N, 3) in its own unit, FLU.
        lag: returns the lag of two signals on the grids, s.
        offset: of the track's clock as the mapping states it, s.

    Raises LogFormatError.
    """
    rows = raw.rows
    orders = [rows.quaternion_order] if rows.quaternion_order else list(ORDERS)
    ways = [rows.quaternion_maps] if rows.quaternion_maps else list(WAYS)
    gyro = on_grid(grids[0], imu[0], imu[2])
    every = dict.fromkeys([*product(orders, ways), *product(ORDERS, WAYS)])
    fits = [
        _fit(raw, order, way=way, grids=grids, imu=imu, gyro=gyro, lag=lag, offset=offset)
        for order, way in every
    ]
    chosen = max(fits[: len(orders) * len(ways)], key=lambda one: one.score)
    best = max(fits, key=lambda one: one.score)
    if float(np.sqrt(chosen.rate.var(axis=0).sum())) < STILL:
        return chosen, False
    if chosen.score > max(FITS, NEARLY * best.score):
        return chosen, True
    finding = (
        f"[{raw.name}] the gyroscope explains {chosen.turn.explained:.0%} of the attitude's "
        f"turning, and gravity is along its world's z by {chosen.upright:.0%}"
    )
    if raw.rows.euler is not None or (raw.rows.attitude and raw.rows.attitude.euler is not None):
        raise LogFormatError(
            f"{finding}: are euler_order and euler_unit right, and are these the right columns?"
        )
    if best.score > FITS:
        raise LogFormatError(
            f'{finding}: write quaternion_order = "{best.order}", quaternion_maps = "{best.way}"'
        )
    if chosen.turn.explained < FITS:
        raise LogFormatError(f"{finding}: are these the right columns, and of the same flight?")
    raise LogFormatError(
        f"{finding}: write [imu] body and [{raw.name}] body and world as they are, or leave them "
        "out"
    )


def _fit(
    raw: RawTrack,
    order: str,
    way: str,
    grids: tuple[Array, Array],
    imu: tuple[Array, Array, Array],
    gyro: Array,
    lag: Callable[[Array, Array], float],
    offset: float,
) -> Fit:
    assert raw.quaternion is not None
    mine, theirs = grids
    each = max(1, int((theirs[1] - theirs[0]) / max(usual_step(raw.seconds), 1e-6)))
    at = raw.seconds[::each] + offset
    attitude = ordered(raw.quaternion[::each], order, way)
    rate = on_grid(theirs, at, angular_velocity(at, attitude))
    moved = lag(gyro, rate)
    inside = (mine >= theirs[0] + moved) & (mine <= theirs[-1] + moved)
    inside &= away_from_gaps(mine - moved, at)
    turn = best_turn(interpolated(mine[inside] - moved, theirs, rate), gyro[inside])
    body = axes(raw.rows.body or nearest_body(turn.matrix), "body")
    some = slice(None, None, 1 + len(at) // ROWS)
    force = interpolated(at[some] + moved, imu[0], imu[1]) @ body
    mean = np.einsum("nij,nj->i", matrices_of(attitude[some]), force) / len(force)
    return Fit(order, way, turn, rate, min(1.0, abs(float(mean[2])) / GRAVITY))
