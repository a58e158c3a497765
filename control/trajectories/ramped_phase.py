"""A phase that runs at a constant rate between smooth ramps: the time law of lines and laps."""

from __future__ import annotations

from quadrotor.compiled import compiled

Derivatives = tuple[float, float, float, float, float]
"""A quantity and its first four time derivatives."""

RAMP_SLOPE = 2.1875
"""Largest slope of the ramp S: a ramp of r seconds to the rate w needs RAMP_SLOPE w / r."""

RAMP_BEND = 7.5131884
"""Largest |S''|, 84 sqrt(5) / 25, at x = (5 - sqrt 5) / 10 and its mirror image."""


@compiled(inner=True)
def ramped_phase(t: float, rate: float, ramp: float, total: float) -> Derivatives:
    """Return phase and its derivatives to the fourth at t (s).

    The rate follows S(x) = 35 x^4 - 84 x^5 + 70 x^6 - 20 x^7, x = t / ramp, so the phase is C4.
    It rests at 0 before t = 0 and at `total` after total / rate + ramp seconds.

    Args:
        rate: 1/s, > 0.
        ramp: s, > 0, at most total / rate.
        total: phase at the end; inf for no end.
    """
    end = total / rate + ramp
    if t <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    if t >= end:
        return total, 0.0, 0.0, 0.0, 0.0
    rising = t < ramp
    if not rising and t <= end - ramp:
        return rate * (t - 0.5 * ramp), rate, 0.0, 0.0, 0.0
    # The ramp down is the ramp up in mirrored time: odd derivatives of the rate change sign.
    sign = 1.0 if rising else -1.0
    per = 1.0 / ramp
    x = (t if rising else end - t) * per
    x2 = x * x
    x4 = x2 * x2
    xy = x * (1.0 - x)
    area = rate * ramp * x4 * x * (7.0 - 14.0 * x + 10.0 * x2 - 2.5 * x2 * x)
    bend = rate * per
    return (
        area if rising else total - area,
        rate * x4 * (35.0 - 84.0 * x + 70.0 * x2 - 20.0 * x2 * x),
        sign * bend * 140.0 * xy * xy * xy,
        bend * per * 420.0 * xy * xy * (1.0 - 2.0 * x),
        sign * bend * per * per * 840.0 * xy * (1.0 - 5.0 * xy),
    )
