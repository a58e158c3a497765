"""Least and greatest values of ever more samples: a whole flight drawn from some thousand numbers.

Level 0 are the samples; a bin of level k holds FACTOR**k of them.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FACTOR = 16
TOP = 1024
"""Bins at most in the highest level."""

Array = npt.NDArray[np.float32]


def level_sizes(count: int) -> list[int]:
    """Return bins of the levels 1, 2, … of `count` samples."""
    sizes = []
    while count > TOP:
        count = -(-count // FACTOR)
        sizes.append(count)
    return sizes


def coarser(low: Array, high: Array, factor: int) -> tuple[Array, Array]:
    """Return bins of `factor` values, the last one of what is left; NaN only where all are."""
    if factor <= 1 or len(low) == 0:
        return low, high
    begins = np.arange(0, len(low), factor)
    return np.fmin.reduceat(low, begins), np.fmax.reduceat(high, begins)


def pyramid(values: Array) -> list[tuple[Array, Array]]:
    """Return least and greatest of the levels 1, 2, …"""
    levels = []
    low = high = values
    for _ in level_sizes(len(values)):
        low, high = coarser(low, high, FACTOR)
        levels.append((low, high))
    return levels


def edges(times: npt.NDArray[np.float64], size: int) -> npt.NDArray[np.float64]:
    """Return times of the first and the last sample of each bin of `size` samples, shape (2,
    bins).
    """
    first = np.arange(0, len(times), size)
    last = np.minimum(first + size, len(times)) - 1
    return np.stack([times[first], times[last]])
