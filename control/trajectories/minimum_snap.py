"""A path through way-points with the least snap, from rest to rest.

The integral of the squared snap is least among all paths of ninth-order pieces that pass the
way-points at their times, rest at both ends and join C4; the yaw has the least acceleration in the
same sense. It is a quadratic problem whose unknowns are the derivatives at the inner way-points
(Richter, Bry, Roy 2013): its normal equations are block-tridiagonal and are solved directly.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from control.trajectories.polynomial import ORDER, Polynomial, ends_to_coefficients
from quadrotor.records import REFERENCE

Array = npt.NDArray[np.float64]

_COEFFICIENTS = ends_to_coefficients()
_FREE = 4  # velocity to snap
_FACTOR_MIN = 1e-3


def _cost(order: int) -> Array:
    """Return the cost matrix (10, 10) of value-to-snap at both ends.

    The cost is the integral over 0..1 of the squared derivative.
    """
    power = np.arange(ORDER + 1)
    falling = np.array([math.perm(n, order) for n in power], dtype=float)
    exponent = np.maximum(power[:, None] + power[None, :] - 2 * order + 1, 1)
    weights = np.outer(falling, falling) / exponent
    out: Array = _COEFFICIENTS.T @ weights @ _COEFFICIENTS
    return out


_SNAP = _cost(4)
_YAW_ACCELERATION = _cost(2)


def check_way_points(waypoints: Array, times: Array) -> tuple[Array, Array]:
    """Return both as arrays of floats. Raises ValueError for invalid shapes, values or times."""
    points, at = np.asarray(waypoints, dtype=float), np.asarray(times, dtype=float)
    if points.ndim != 2 or points.shape != (len(at), 4) or len(at) < 2:
        raise ValueError(
            f"way-points of shape {points.shape} with {len(at)} times: "
            "give (S + 1, 4) points and S + 1 times, S at least 1"
        )
    if not np.all(np.isfinite(points)):
        raise ValueError("way-points must be finite numbers")
    if at[0] != 0.0 or not np.all(np.diff(at) > 0.0) or not np.isfinite(at[-1]):
        raise ValueError(f"times from {at[0]:g} to {at[-1]:g} s must start at 0 and grow")
    return points, at


def minimum_snap(waypoints: Array, times: Array) -> Polynomial:
    """Return the path through way-points at given times.

    Args:
        waypoints: (S + 1, 4) x, y, z (m), yaw (rad, not wrapped).
        times: (S + 1,) s, from 0, increasing.

    Raises ValueError when the shapes do not fit or the times do not increase from 0.
    """
    points, at = check_way_points(waypoints, times)
    spans = np.diff(at) / (at[-1] / (len(at) - 1))  # about 1: the powers below stay harmless
    ends = np.zeros((len(at), 4, 5))
    ends[:, :, 0] = points
    ends[1:-1, :3, 1:] = _inner_derivatives(points[:, :3], spans, _SNAP, 7)
    ends[1:-1, 3:, 1:] = _inner_derivatives(points[:, 3:], spans, _YAW_ACCELERATION, 3)
    scale = spans[:, None, None] ** np.arange(5.0)
    joined = np.concatenate([ends[:-1] * scale, ends[1:] * scale], axis=2)
    return Polynomial(at, joined @ _COEFFICIENTS.T)


def _inner_derivatives(points: Array, spans: Array, cost: Array, power: int) -> Array:
    """Return (S - 1, D, 4): velocity to snap at the inner way-points, in the time units of `spans`.

    Args:
        points: (S + 1, D).
        spans: (S,).
        cost: (10, 10) of a piece of unit span; a piece of span T costs T^-power as much.
    """
    scale = spans[:, None] ** np.array([0.0, 1.0, 2.0, 3.0, 4.0] * 2)
    pieces = cost * scale[:, :, None] * scale[:, None, :] * (spans**-power)[:, None, None]
    first, second = slice(1, 5), slice(6, 10)
    here = pieces[:-1, second, second] + pieces[1:, first, first]
    onward = pieces[1:-1, first, second]
    pulled = (
        pieces[:-1, second, 0:1] * points[:-2, None]
        + (pieces[:-1, second, 5:6] + pieces[1:, first, 0:1]) * points[1:-1, None]
        + pieces[1:, first, 5:6] * points[2:, None]
    )
    return _block_tridiagonal(here, onward, -pulled).swapaxes(1, 2)


def _block_tridiagonal(here: Array, onward: Array, right: Array) -> Array:
    """Return x of a symmetric positive system with blocks here (N, 4, 4), onward (N - 1, 4, 4)."""
    n = len(here)
    out = np.empty_like(right)
    carried = np.empty((max(n - 1, 0), _FREE, _FREE))
    for k in range(n):
        if k:
            block = here[k] - onward[k - 1].T @ carried[k - 1]
            rest = right[k] - onward[k - 1].T @ out[k - 1]
        else:
            block, rest = here[0], right[0]
        both = np.linalg.solve(block, np.hstack([onward[k], rest]) if k < n - 1 else rest)
        if k < n - 1:
            carried[k] = both[:, :_FREE]
        out[k] = both[:, both.shape[1] - right.shape[2] :]
    for k in range(n - 2, -1, -1):
        out[k] -= carried[k] @ out[k + 1]
    return out


def within(
    waypoints: Array, *, speed: float, acceleration: float, yaw_rate: float, yaw_acceleration: float
) -> Polynomial:
    """Return the path through way-points, as fast as the bounds allow for one division of the time.

    Each piece gets the time that its length, its turn and the bounds suggest. A path of least snap
    that is slowed down is still one of least snap, so one factor on all times then meets the
    tightest bound exactly.

    Args:
        waypoints: (S + 1, 4) x, y, z (m), yaw (rad, not wrapped); neighbours differ.
        speed, acceleration, yaw_rate, yaw_acceleration: bounds, SI, > 0.

    Raises ValueError for invalid way-points.
    """
    points = np.asarray(waypoints, dtype=float)
    change = np.diff(points, axis=0)
    distance, turn = np.linalg.norm(change[:, :3], axis=1), np.abs(change[:, 3])
    spans = np.maximum(
        np.maximum(distance / speed, np.sqrt(distance / acceleration)),
        np.maximum(turn / yaw_rate, np.sqrt(turn / yaw_acceleration)),
    )
    # Starting from rest and stopping take longer than passing by.
    spans[0], spans[-1] = 1.5 * spans[0], 1.5 * spans[-1]
    path = minimum_snap(points, np.concatenate([[0.0], np.cumsum(spans)]))
    # Enough also for the shortest piece of a path whose pieces last very differently.
    seen = np.empty(256 * len(spans), REFERENCE)
    path.sample_grid(0.0, path.duration / (len(seen) - 1), seen)
    factor = max(
        float(np.linalg.norm(seen["velocity_w"], axis=1).max()) / speed,
        math.sqrt(float(np.linalg.norm(seen["acceleration_w"], axis=1).max()) / acceleration),
        float(np.abs(seen["yaw_rate"]).max()) / yaw_rate,
        math.sqrt(float(np.abs(seen["yaw_acceleration"]).max()) / yaw_acceleration),
        _FACTOR_MIN,
    )
    # The peaks between the samples are higher by less than this factor.
    return path.slowed(1.002 * factor)
