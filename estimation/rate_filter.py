"""Low-pass of the angular velocity (end of Sec. 6.1), and a notch before it.

d/dt omega = 2 pi f (omega_m - omega), integrated exactly for a held input: explicit Euler, which
the printed form suggests, diverges below a rate of pi f (471 Hz at 150 Hz).

The notch (s^2 + w^2) / (s^2 + B s + w^2) removes the vibration of the rotors at one frequency; it
delays much lower frequencies by B / w^2. The paper has none.
"""

from __future__ import annotations

import math

from quadrotor.compiled import compiled
from quadrotor.records import Array, Item
from quadrotor.vectors import Vector, vector

HIGHEST = 0.45
"""Share of the sampling rate above which a notch is disabled: there is nothing left to remove."""


@compiled(inner=True)
def filter_rate(m: Item, measured: Array, bias: Array, g: Item, dt: float) -> None:
    """Move `m.filtered_rate_b` (3,) towards `measured - bias` (3,), through notch and low-pass.

    Args:
        m: a memory with `filtered_rate_b`, `notch_hz` and `notch_b` (3, 2).
        g: gains with `rate_low_pass`, `rate_notch` and `rate_notch_width`, Hz.
        dt: s since the last sample.
    """
    share = -math.expm1(-2.0 * math.pi * g.rate_low_pass * dt)
    rate = vector(measured)
    if 0.0 < g.rate_notch * dt < HIGHEST:
        rate = notch(m, rate, g.rate_notch, g.rate_notch_width, dt)
    else:
        m.notch_hz = 0.0
    for i in range(3):
        m.filtered_rate_b[i] += share * (rate[i] - bias[i] - m.filtered_rate_b[i])


@compiled(inner=True)
def notch(m: Item, rate: Vector, hertz: float, width: float, dt: float) -> Vector:
    """Return a body rate without its components around a frequency (Hz). When switched on or moved
    to another frequency, the notch starts as if it had always measured this rate.
    """
    k = math.tan(math.pi * hertz * dt)  # bilinear transform, exact at the frequency
    damping = k * width / hertz
    whole = 1.0 + k * k + damping
    through = (1.0 + k * k) / whole
    back, last = 2.0 * (k * k - 1.0) / whole, (1.0 + k * k - damping) / whole
    if m.notch_hz != hertz:
        m.notch_hz = hertz
        for i in range(3):
            m.notch_b[i, 0], m.notch_b[i, 1] = (1.0 - through) * rate[i], (through - last) * rate[i]
    x = _notched(m.notch_b[0], rate[0], through, back, last)
    y = _notched(m.notch_b[1], rate[1], through, back, last)
    return x, y, _notched(m.notch_b[2], rate[2], through, back, last)


@compiled(inner=True)
def _notched(memory: Array, value: float, through: float, back: float, last: float) -> float:
    out: float = through * value + memory[0]
    memory[0] = back * (value - out) + memory[1]
    memory[1] = through * value - last * out
    return out
