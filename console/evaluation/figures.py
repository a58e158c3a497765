"""Figures of a series of values."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def rms(values: npt.NDArray[np.floating]) -> float:
    """Return the root mean square of all values."""
    return float(np.sqrt(np.mean(values**2)))
