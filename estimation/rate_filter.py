"""Low-pass of the angular velocity (end of Sec. 6.1).

d/dt omega = 2 pi f (omega_m - omega), integrated exactly for a held input: explicit Euler, as
the printed form invites, diverges below a rate of pi f (471 Hz at 150 Hz).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled

Array = npt.NDArray[np.float64]


@compiled(inner=True)
def low_pass(filtered: Array, measured: Array, bias: Array, cut_off: float, dt: float) -> None:
    """Move `filtered` (3,) towards `measured - bias` (3,), in place.

    Args:
        cut_off: Hz.
        dt: s since the last sample.
    """
    share = -math.expm1(-2.0 * math.pi * cut_off * dt)
    for i in range(3):
        filtered[i] += share * (measured[i] - bias[i] - filtered[i])
