"""The Allan variance of a series of values."""

from __future__ import annotations

import numpy as np

from quadrotor.records import Array


def allan_variance(values: Array, count: int) -> Array:
    """Return the overlapping Allan variance (K,) of (N, K) for means over `count` samples."""
    sums = np.cumsum(np.vstack([np.zeros(values.shape[1]), values]), axis=0)
    steps = sums[2 * count :] - 2.0 * sums[count:-count] + sums[: -2 * count]
    variance: Array = 0.5 * np.mean((steps / count) ** 2, axis=0)
    return variance
