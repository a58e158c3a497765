"""Low-pass of the angular velocity (end of Sec. 6.1), and a notch before it.

d/dt omega = 2 pi f (omega_m - omega), integrated exactly for a held input: explicit Euler, as
the printed form invites, diverges below a rate of pi f (471 Hz at 150 Hz).

The notch (s^2 + w^2) / (s^2 + B s + w^2) takes out the vibration of the rotors at one frequency; it
delays what is far below by B / w^2. The paper has none.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled

Array = npt.NDArray[np.float64]

HIGHEST = 0.45
"""Share of the sampling rate above which a notch is left out: there is nothing left to take out."""


@compiled(inner=True)
def filter_rate(m: Any, measured: Array, bias: Array, g: Any, dt: float) -> None:
    """Move `m.filtered_rate_b` (3,) towards `measured - bias` (3,), through notch and low-pass.

    Args:
        m: a memory with `filtered_rate_b`, `notch_hz` and `notch_b` (3, 2).
        g: gains with `rate_low_pass`, `rate_notch` and `rate_notch_width`, Hz.
        dt: s since the last sample.
    """
    share = -math.expm1(-2.0 * math.pi * g.rate_low_pass * dt)
    on = 0.0 < g.rate_notch * dt < HIGHEST
    k = math.tan(math.pi * g.rate_notch * dt) if on else 0.0  # bilinear, exact at the frequency
    damping = k * g.rate_notch_width / g.rate_notch if on else 0.0
    through = (1.0 + k * k) / (1.0 + k * k + damping)
    back = 2.0 * (k * k - 1.0) / (1.0 + k * k + damping)
    last = (1.0 + k * k - damping) / (1.0 + k * k + damping)
    for i in range(3):
        value = measured[i]
        if on:
            memory = m.notch_b[i]
            if m.notch_hz != g.rate_notch:  # as if it had always measured this
                memory[0], memory[1] = (1.0 - through) * value, (through - last) * value
            value = through * measured[i] + memory[0]
            memory[0] = back * (measured[i] - value) + memory[1]
            memory[1] = through * measured[i] - last * value
        m.filtered_rate_b[i] += share * (value - bias[i] - m.filtered_rate_b[i])
    m.notch_hz = g.rate_notch if on else 0.0
