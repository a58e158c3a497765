"""Values of one topic at the stamps of another."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

LARGEST_GAP_NS = 20_000_000
"""Between messages farther apart nothing is interpolated."""


def at_stamps(
    stamps: npt.NDArray[np.int64], messages: Mapping[int, Array]
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Linearly between the neighbours; exactly a message where one has the very stamp.

    In simulated time the stamps of all topics meet; over a link each source has its own.

    Args:
        stamps: (N,) ns. messages: stamp in ns → (K,) values; quaternions in them must not flip
            their sign between neighbours farther than they turn.

    Returns:
        (N, K) values, and (N,) which of them are known; the others are NaN.
    """
    if not messages:
        return np.full((len(stamps), 0), np.nan), np.zeros(len(stamps), bool)
    given = np.array(sorted(messages), np.int64)
    values = np.array([messages[int(ns)] for ns in given])
    after = np.clip(np.searchsorted(given, stamps), 0, len(given) - 1)
    before = np.where(given[after] == stamps, after, np.maximum(after - 1, 0))
    gap = given[after] - given[before]
    inside = (given[before] <= stamps) & (stamps <= given[after]) & (gap <= LARGEST_GAP_NS)
    share = np.where(gap > 0, (stamps - given[before]) / np.maximum(gap, 1), 0.0)[:, None]
    out: Array = values[before] + share * (values[after] - values[before])
    out[~inside] = np.nan
    return out, inside
