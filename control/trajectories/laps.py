"""The common part of trajectories in laps: a phase at a constant rate between two ramps."""

from __future__ import annotations

import math

from control.trajectories.trajectory import Stretch

PER_RAMP = 100
PER_LAP = 160


def check_ramp(laps: int, period: float, ramp: float) -> None:
    """Raise ValueError for a ramp that does not fit into the laps."""
    if not 0.0 < ramp <= laps * period:
        raise ValueError(
            f"a ramp of {ramp:g} s does not fit into {laps} laps of {period:g} s: "
            f"give one up to {laps * period:g} s"
        )


def lap_rates(laps: int, period: float) -> tuple[float, float]:
    """Return rate (rad/s) and total (rad) of the phase."""
    return 2.0 * math.pi / period, 2.0 * math.pi * laps


def lap_stretches(laps: int, period: float, ramp: float) -> tuple[Stretch, ...]:
    """Return the ramps, and between them at most one lap: further ones repeat it."""
    end = laps * period + ramp
    steady = end - 2.0 * ramp
    shown = min(period, steady)
    count = max(2, math.ceil(PER_LAP * shown / period))
    per_ramp = max(PER_RAMP, math.ceil(0.5 * PER_LAP * ramp / period))
    between = ((ramp, ramp + shown, count),) if shown > 1e-9 else ()
    return (0.0, ramp, per_ramp), *between, (end - ramp, end, per_ramp)
