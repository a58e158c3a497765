"""Lines of a spectrum, named after the rotors that cause them.

A line within NEAR of a rotor's frequency, or of its blades' (twice as high), is named after it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quadrotor.constants import MOTORS
from quadrotor.records import Array

BLADES = 2
"""Number of blades of a propeller."""
NEAR = 0.06
"""Share by which a line may differ from a rotor's frequency, because propellers differ."""
HEIGHT = 8.0
"""Multiple of the floor above which a peak is a line: the floor itself hardly ever reaches it."""


@dataclass(frozen=True, slots=True)
class Line:
    """A peak: frequency in Hz, rms in the reading's unit, and the rotors it may come from."""

    frequency: float
    rms: float
    source: str


def lines_of(frequency: Array, density: Array, rotors: Array, lowest: float) -> list[Line]:
    """Return the lines of a spectrum (M,) above `lowest` (Hz), strongest first.

    Args:
        rotors: (4,) Hz, turns per second.
    """
    floor = float(np.median(density[frequency >= lowest]))
    high = (density > HEIGHT * floor) & (frequency >= lowest)
    edges = np.flatnonzero(np.diff(high.astype(int), prepend=0, append=0))
    step = float(frequency[1])
    found = []
    for first, last in edges.reshape(-1, 2):
        part = density[first:last]
        peak = float(np.sum(frequency[first:last] * part) / part.sum())
        rms = float(np.sqrt(part.sum() * step))
        found.append(Line(peak, rms, _source(peak, rotors)))
    return sorted(found, key=lambda line: -line.rms)


def _source(frequency: float, rotors: Array) -> str:
    """Return the source of a line as text: all rotors that are about as near as the nearest."""
    for order, name in ((1, "rotor"), (BLADES, "blades")):
        off = np.abs(frequency / (order * np.maximum(rotors, 1e-9)) - 1.0)
        if off.min() <= NEAR:
            near = [MOTORS[k] for k in range(4) if off[k] <= off.min() + 0.01]
            return f"{name} {' or '.join(near)}" if len(near) < len(MOTORS) else f"{name}"
    return "unknown"
