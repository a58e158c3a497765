"""The touch-down of a flight with a failure, from the truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

TOUCHING = 0.005
"""Height, in m, below which the feet touch the ground."""
IMPACT_MAX = 0.8
"""Largest impact, in m/s, of a good landing."""
UPRIGHT = math.radians(15.0)


@dataclass
class Outcome:
    """One flight. Speeds m/s, angles rad, lengths m, times s since the failure; NaN for never."""

    failure: str
    start: str
    seed: int
    impact: float = math.nan  # largest vertical speed at touch-down
    tilt: float = math.nan  # at touch-down
    tilt_max: float = 0.0  # since the failure
    drift: float = math.nan  # horizontally, from the place of the failure to the touch-down
    down: float = math.nan
    off: float = math.nan
    end_tilt: float = 0.0
    broken: bool = False  # whether it reached its failure
    why: str = ""  # what went wrong

    @property
    def verdict(self) -> str:
        if self.why:
            return self.why
        if math.isnan(self.down) or math.isnan(self.off):
            return "not down"
        if max(self.tilt, self.end_tilt) > UPRIGHT:
            return "not upright"
        return "landed" if self.impact <= IMPACT_MAX else "hard"


class TouchDown:
    """Observer of one flight from the failure on.

    Args:
        outcome: filled in.
        now: s, time of the failure.
        place: (x, y, z) m, at the failure.
    """

    def __init__(self, outcome: Outcome, now: float, place: Sequence[float]) -> None:
        self._outcome = outcome
        self._began = now
        self._place = place[0], place[1]
        self._sinking = 0.0

    def note(
        self, now: float, position_w: Sequence[float], climb: float, quaternion_wb: Sequence[float]
    ) -> None:
        """Add one state of the truth, in the order of time."""
        outcome = self._outcome
        tilt = tilt_of(quaternion_wb)
        outcome.end_tilt = tilt
        outcome.tilt_max = max(outcome.tilt_max, tilt)
        if position_w[2] < TOUCHING:
            if math.isnan(outcome.down):
                outcome.down = now - self._began
                outcome.drift = math.dist(position_w[:2], self._place)
                outcome.impact, outcome.tilt = max(0.0, self._sinking), tilt
            elif self._sinking > outcome.impact:  # after a bounce
                outcome.impact, outcome.tilt = self._sinking, max(tilt, outcome.tilt)
        self._sinking = -climb


def tilt_of(quaternion_wb: Sequence[float]) -> float:
    """Return the angle between z_B and z_W, rad."""
    _, x, y, _ = quaternion_wb
    return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))
