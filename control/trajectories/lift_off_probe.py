"""A small circle at lift-off that shows whether the tracker turns as the vehicle does.

A tracker whose axes are reversed or permuted looks right while the vehicle stands or climbs
upright. One turn of a circle of some millimetres tilts the vehicle by some degrees in every
direction, while it is still near the ground, so that poses and gyroscope can be compared there.

The circle is drawn under the envelope sin(pi s)^4, s from 0 to 1, so that it begins and ends
without a jump in jerk: in complex numbers a sum of five harmonics of exp(2 pi i s).
"""

from __future__ import annotations

import math

from quadrotor.compiled import compiled
from quadrotor.constants import GRAVITY
from quadrotor.records import Item, Record

BEGINS = 0.005
"""Height, in m, of the reference above its start from which on the circle is flown."""
DURATION = 0.5
"""Duration, in s, of the circle."""
_RATE = 2.0 * math.pi / DURATION
_HARMONICS = ((-1.0, 1.0 / 16.0), (0.0, -0.25), (1.0, 0.375), (2.0, -0.25), (3.0, 1.0 / 16.0))
"""The order and the share of each harmonic; they add up to an acceleration of 2 rate² at most."""


@compiled(inner=True)
def add_probe_at(t: float, tilt: float, reference: Item) -> None:
    """Add the circle at t (s) since it began to one REFERENCE record.

    Args:
        tilt: largest tilt, in rad, that its acceleration needs.
    """
    if not 0.0 < t < DURATION:
        return
    size = 0.5 * GRAVITY * math.tan(tilt) / _RATE**2
    for order, share in _HARMONICS:
        w = order * _RATE
        x, y = share * size * math.cos(w * t), share * size * math.sin(w * t)
        reference.position_w[0] += x
        reference.position_w[1] += y
        reference.velocity_w[0] -= w * y
        reference.velocity_w[1] += w * x
        reference.acceleration_w[0] -= w * w * x
        reference.acceleration_w[1] -= w * w * y
        reference.jerk_w[0] += w**3 * y
        reference.jerk_w[1] -= w**3 * x
        reference.snap_w[0] += w**4 * x
        reference.snap_w[1] += w**4 * y


@compiled
def add_probe(t: float, tilt: float, reference: Record) -> None:
    """Add the circle to a REFERENCE (1,); see `add_probe_at`."""
    add_probe_at(t, tilt, reference[0])
