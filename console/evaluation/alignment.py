"""Values of one topic at the stamps of another."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]

LARGEST_GAP_NS = 20_000_000
"""Largest gap, in ns, between messages for interpolation."""


def between(
    stamps: Stamps, given: Stamps, values: npt.NDArray[np.floating]
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Interpolate linearly between neighbours; a message with exactly a given stamp is used as is.

    In simulated time the stamps of all topics coincide; over a link each source has its own.

    Args:
        stamps: (N,) ns.
        given: (M,) ns, rising.
        values: (M, K); quaternions in them must not flip their sign between neighbours.

    Returns:
        (N, K) values, and (N,) which of them are known; the others are NaN.
    """
    if not len(given):
        return np.full((len(stamps), values.shape[1]), np.nan), np.zeros(len(stamps), bool)
    after = np.clip(np.searchsorted(given, stamps), 0, len(given) - 1)
    before = np.where(given[after] == stamps, after, np.maximum(after - 1, 0))
    gap = given[after] - given[before]
    inside = (given[before] <= stamps) & (stamps <= given[after]) & (gap <= LARGEST_GAP_NS)
    share = np.where(gap > 0, (stamps - given[before]) / np.maximum(gap, 1), 0.0)[:, None]
    first = values[before].astype(np.float64)
    out: Array = first + share * (values[after] - first)
    out[~inside] = np.nan
    return out, inside
