"""Height and climb rate by barometer and accelerometer: an observer with three equal poles.

The barometer alone, 0.2 m of noise a sample, gives a climb rate only over seconds; the
accelerometer alone drifts. The third state is the bias of the vertical specific force.
"""

from __future__ import annotations

from typing import Any

from quadrotor.compiled import compiled
from vehicle.simulator.firmware.attitude import vertical
from vehicle.simulator.firmware.constants import (
    CLIMB_BIAS_MAX,
    CLIMB_MAX,
    GRAVITY_COUNTS,
    HEIGHT_ERROR_MAX,
)
from vehicle.simulator.firmware.fixed import bounded, by16

Item = Any
"""One record `array[k]` inside compiled code."""


@compiled(inner=True)
def estimate_climb(p: Item, barometer: int) -> None:
    """Update height and climb rate of a PROGRAM for one period, after its attitude.

    Args:
        barometer: height (2^-18 m).
    """
    if not p.awake:
        p.height, p.climb, p.climb_bias = barometer, 0, 0
    g, f, up = p.gains, p.force_b, vertical(p)
    force = up[0] * f[0] + up[1] * f[1] + up[2] * f[2] - GRAVITY_COUNTS - (p.climb_bias >> 8)
    climb = p.climb + by16(force, g.up)
    height = p.height + ((by16(climb, g.second) + 0x200) >> 10)
    error = bounded(barometer - height, HEIGHT_ERROR_MAX)
    to_height = g.height if p.turning else g.height_resting
    to_climb = g.climb if p.turning else g.climb_resting
    to_bias = g.bias if p.turning else g.bias_resting
    p.height = height + by16(error, to_height)
    p.climb = bounded(climb + by16(error << 3, to_climb), CLIMB_MAX)
    p.climb_bias = bounded(p.climb_bias - by16(error << 8, to_bias), CLIMB_BIAS_MAX)
    if not p.turning:
        p.ground = p.height
