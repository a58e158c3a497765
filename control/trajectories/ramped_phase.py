"""A phase that runs at a constant rate between smooth ramps: the time law of lines and eights."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled

Array = npt.NDArray[np.float64]

RAMP_SLOPE = 2.1875
"""Largest slope of the ramp S: a ramp of r seconds to the rate w needs RAMP_SLOPE w / r."""


@compiled
def ramped_phase(t: float, rate: float, ramp: float, total: float, out: Array) -> None:
    """Phase and its derivatives to the fourth, shape (5,), at t (s), into out.

    The rate follows S(x) = 35 x^4 - 84 x^5 + 70 x^6 - 20 x^7, x = t / ramp, so the phase is C4.
    It rests at 0 before t = 0 and at `total` after total / rate + ramp seconds.

    Args:
        rate: 1/s, > 0.
        ramp: s, > 0, at most total / rate.
        total: phase at the end; inf for no end.
    """
    end = total / rate + ramp
    for i in range(5):
        out[i] = 0.0
    if t <= 0.0:
        return
    if t >= end:
        out[0] = total
        return
    rising = t < ramp
    if not rising and t <= end - ramp:
        out[0] = rate * (t - 0.5 * ramp)
        out[1] = rate
        return
    x = (t if rising else end - t) / ramp
    y = 1.0 - x
    x2 = x * x
    area = x2 * x2 * x * (7.0 - 14.0 * x + 10.0 * x2 - 2.5 * x2 * x)
    out[0] = rate * ramp * area if rising else total - rate * ramp * area
    out[1] = rate * x2 * x2 * (35.0 - 84.0 * x + 70.0 * x2 - 20.0 * x2 * x)
    # The ramp down is the ramp up in mirrored time: odd derivatives of the rate change sign.
    sign = 1.0 if rising else -1.0
    out[2] = sign * rate / ramp * 140.0 * x2 * x * y * y * y
    out[3] = rate / (ramp * ramp) * 420.0 * x2 * y * y * (1.0 - 2.0 * x)
    out[4] = sign * rate / (ramp * ramp * ramp) * 840.0 * x * y * (1.0 - 5.0 * x + 5.0 * x2)
