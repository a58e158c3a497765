"""A trajectory from tabulated motion: position to snap and yaw to acceleration at given times."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from control.trajectories.polynomial import Polynomial, ends_to_coefficients
from control.trajectories.trajectory import Trajectory, sample_many
from quadrotor.errors import RefusedError
from quadrotor.records import Record

Array = npt.NDArray[np.float64]

SPACING = 0.02
"""Time, in s, between the rows of a table made from a trajectory."""

DURATION_MAX = 600.0
"""Longest duration, in s."""

REST = 1e-3
"""Largest derivative (SI) at an end that counts as rest."""

_CHAIN = ("position_w", "velocity_w", "acceleration_w", "jerk_w", "snap_w")
_YAW_CHAIN = ("yaw", "yaw_rate", "yaw_acceleration")
_COEFFICIENTS = ends_to_coefficients()


def join(times: Array, motion: Array) -> Polynomial:
    """Return pieces of ninth order through a table; C4.

    Args:
        times: (N,) s, from 0, increasing.
        motion: (N, 4, 5) x, y, z, yaw, each to its 4th derivative.
    """
    scale = np.diff(times)[:, None, None] ** np.arange(5.0)
    ends = np.concatenate([motion[:-1] * scale, motion[1:] * scale], axis=2)
    # Each piece is relative to its own start: the position's rounding error would return over
    # seconds^4.
    start = ends[:, :, 0].copy()
    ends[:, :, 0] = 0.0
    ends[:, :, 5] -= start
    coefficients = ends @ _COEFFICIENTS.T
    coefficients[:, :, 0] = start
    return Polynomial(times, coefficients)


def check_rest(name: str, times: Array, motion: Array) -> None:
    """Raise RefusedError when a table (see `join`) does not start and end at rest.

    Derivatives within REST of zero are set to zero.
    """
    for end, word in ((0, "starts"), (-1, "ends")):
        moving = np.abs(motion[end, :, 1:]).max(axis=0)
        for order, size in enumerate(moving.tolist(), start=1):
            if size > REST:
                what = _CHAIN[order].removesuffix("_w")
                raise RefusedError(
                    f"{name}: {word} with a {what} of {size:.3g} (SI) at {times[end]:g} s; a "
                    "trajectory starts and ends at rest, all derivatives zero"
                )
        motion[end, :, 1:] = 0.0


def tabulate(name: str, trajectory: Trajectory) -> Polynomial:
    """Return a finite trajectory as pieces of ninth order: fast, and unable to fail in flight.

    Raises RefusedError when its samples are not finite, not consistent derivatives of each other,
    or not at rest at the ends.
    """
    duration = float(trajectory.duration)
    if not 0.0 < duration <= DURATION_MAX:
        raise RefusedError(
            f"{name}: a duration of {duration:g} s; allowed above 0 to {DURATION_MAX:g} s"
        )
    count = max(2, round(duration / SPACING))
    # Every second sample lies between two rows of the table and only checks it.
    times = np.linspace(0.0, duration, 2 * count + 1)
    samples = sample_many(trajectory, times)
    for chain in (_CHAIN, _YAW_CHAIN):
        for field in chain:
            _check_finite(name, times, samples, field)
        for low, high in pairwise(chain):
            _check_derivative(name, times, samples, low, high)
    motion = np.zeros((count + 1, 4, 5))
    for order, field in enumerate(_CHAIN):
        motion[:, :3, order] = samples[field][::2]
    for order, field in enumerate(_YAW_CHAIN):
        motion[:, 3, order] = samples[field][::2]
    check_rest(name, times[::2], motion)
    return join(times[::2], motion)


def _check_finite(name: str, times: Array, samples: Record, field: str) -> None:
    wrong = ~np.isfinite(samples[field].reshape(len(times), -1)).all(axis=1)
    if wrong.any():
        raise RefusedError(f"{name}: {field} is not finite at {times[np.argmax(wrong)]:.3g} s")


def _check_derivative(name: str, times: Array, samples: Record, low: str, high: str) -> None:
    """Check that `high` is the derivative of `low`, by Simpson's rule over each piece."""
    value = samples[low].reshape(len(times), -1)
    rate = samples[high].reshape(len(times), -1)
    span = float(times[2])
    moved = (value[2::2] - value[:-2:2]) / span
    said = (rate[:-2:2] + 4.0 * rate[1::2] + rate[2::2]) / 6.0
    off = np.abs(moved - said)
    allowed = 0.02 * max(1e-3, float(np.abs(rate).max()), float(np.abs(moved).max()))
    worst = off.max(axis=1)
    if worst.max() > allowed:
        k = int(np.argmax(worst > allowed))
        axis = int(off[k].argmax())
        raise RefusedError(
            f"{name}: {high} is not the derivative of {low} at {times[2 * k + 1]:.3g} s: the "
            f"one moves by {moved[k, axis]:.3g} per second, the other says {said[k, axis]:.3g}"
        )
