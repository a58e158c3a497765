"""Values of one topic at the stamps of another, and rows of attitudes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from quadrotor.plain_rotations import roll_pitch_yaw_of_rows
from quadrotor.records import Array, Stamps

LARGEST_GAP_NS = 20_000_000
"""Largest gap, in ns, between messages of one process."""


def between(
    stamps: Stamps | npt.NDArray[np.floating],
    given: Stamps | npt.NDArray[np.floating],
    values: npt.NDArray[np.floating],
    largest_gap: float = LARGEST_GAP_NS,
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Interpolate linearly between neighbours; a message with exactly a given stamp is used as is.

    In simulated time the stamps of all topics coincide; over a link each source has its own.

    Args:
        stamps: (N,) ns, or another unit of time.
        given: (M,) in the same unit, rising.
        values: (M, K); quaternions in them must not flip their sign between neighbours.
        largest_gap: longest gap between given stamps for interpolation.

    Returns:
        (N, K) values, and (N,) which of them are known; the others are NaN.
    """
    if not len(given):
        return np.full((len(stamps), values.shape[1]), np.nan), np.zeros(len(stamps), bool)
    after = np.clip(np.searchsorted(given, stamps), 0, len(given) - 1)
    before = np.where(given[after] == stamps, after, np.maximum(after - 1, 0))
    gap = given[after] - given[before]
    inside = (given[before] <= stamps) & (stamps <= given[after]) & (gap <= largest_gap)
    share = np.where(gap > 0, (stamps - given[before]) / np.where(gap > 0, gap, 1), 0.0)[:, None]
    first = values[before].astype(np.float64)
    out: Array = first + share * (values[after] - first)
    out[~inside] = np.nan
    return out, inside


def rotated_rows(
    quaternion_wb: npt.NDArray[np.floating], vector_b: npt.NDArray[np.floating]
) -> npt.NDArray[np.floating]:
    """Return R_wb v of each row, (N, 3), of unit quaternions (N, 4) and vectors (N, 3)."""
    axis = quaternion_wb[:, 1:]
    across = 2.0 * np.cross(axis, vector_b)
    rotated: npt.NDArray[np.floating] = (
        vector_b + quaternion_wb[:, :1] * across + np.cross(axis, across)
    )
    return rotated


def roll_pitch_yaw(quaternion_wb: Array) -> Array:
    """Return the angles (rad), shape (N, 3), of quaternions (N, 4); yaw without jumps."""
    angles = roll_pitch_yaw_of_rows(quaternion_wb)
    known = np.isfinite(angles[:, 2])
    angles[known, 2] = np.unwrap(angles[known, 2])
    return angles
