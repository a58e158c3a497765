"""Figures of a series of values."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from quadrotor.records import Array


def rms(values: npt.NDArray[np.floating]) -> float:
    """Return the root mean square of all values."""
    return float(np.sqrt(np.mean(values**2)))


def allan_variance(values: Array, count: int) -> Array:
    """Return the overlapping Allan variance (K,) of (N, K) for means over `count` samples."""
    sums = np.cumsum(np.vstack([np.zeros(values.shape[1]), values]), axis=0)
    steps = sums[2 * count :] - 2.0 * sums[count:-count] + sums[: -2 * count]
    variance: Array = 0.5 * np.mean((steps / count) ** 2, axis=0)
    return variance
