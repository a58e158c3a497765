"""Height and climb rate by barometer and accelerometer: an observer with three equal poles.

The barometer alone, 0.2 m of noise a sample, gives a climb rate only over seconds; the
accelerometer alone drifts. The third state is the bias of the vertical specific force.
"""

from __future__ import annotations

from typing import Any

from quadrotor.compiled import compiled
from quadrotor.vectors import axes_of, quaternion, to_world, vector
from quadrotor.vehicle_model import GRAVITY

Item = Any
"""One record `array[k]` inside compiled code."""

POLE = 1.2
"""rad/s, in flight."""
POLE_RESTING = 4.0
"""rad/s, motors off: fast, as the vehicle may be carried around."""


@compiled(inner=True)
def estimate_climb(p: Item, barometer: float, dt: float) -> None:
    """Estimate for one period of a PROGRAM, after its attitude; `barometer` is a height (m)."""
    if not p.awake:
        p.height, p.climb, p.climb_bias = barometer, 0.0, 0.0
    axes = axes_of(quaternion(p.quaternion_wb))
    up = to_world(axes, vector(p.specific_force_b))[2] - GRAVITY - p.climb_bias
    p.height += p.climb * dt + 0.5 * up * dt * dt
    p.climb += up * dt
    w = POLE if p.turning else POLE_RESTING
    error = barometer - p.height
    p.height += 3.0 * w * dt * error
    p.climb += 3.0 * w * w * dt * error
    p.climb_bias -= w * w * w * dt * error
    if not p.turning:
        p.ground = p.height
