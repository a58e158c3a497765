"""The convergence of an estimate that may be flown on, and the difference of two estimates."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from quadrotor.records import Record


@dataclass(frozen=True, slots=True)
class Convergence:
    """The judgement whether an estimator may be flown on, and its `reason` with numbers.

    Attributes:
        share: of the way there: the smallest ratio, 0 to 1, of what it has to what it needs.
    """

    reached: bool
    reason: str
    share: float = 0.0


@dataclass(frozen=True, slots=True)
class Deviations:
    """Standard deviation of the error vector: m, m/s, rad (root of the covariance's trace)."""

    position: float
    velocity: float
    attitude: float


@dataclass(frozen=True, slots=True)
class Difference:
    """The distance of one STATE from another: m, m/s, rad."""

    position: float
    velocity: float
    attitude: float

    def __str__(self) -> str:
        return f"{self.position:.3f} m, {self.velocity:.3f} m/s, {math.degrees(self.attitude):.2f}°"

    def share_of(self, found: Difference) -> float:
        """Return the smallest ratio of these limits to what was found, at most 1; 0 for NaN."""
        pairs = (
            (self.position, found.position),
            (self.velocity, found.velocity),
            (self.attitude, found.attitude),
        )
        return min(ratio(limit, length) for limit, length in pairs)

    def within(self, other: Difference) -> bool:
        """Return whether each part is at most the other's; False for NaN."""
        return (
            self.position <= other.position
            and self.velocity <= other.velocity
            and self.attitude <= other.attitude
        )


def ratio(limit: float, found: float) -> float:
    """Return limit / found, at most 1; 0 for NaN."""
    if found <= limit:
        return 1.0
    return limit / found if math.isfinite(found) else 0.0


def difference(one: Record, other: Record) -> Difference:
    """Return the difference between two STATE records of shape (1,)."""
    share = abs(float(one["quaternion_wb"][0] @ other["quaternion_wb"][0]))
    return Difference(
        float(np.linalg.norm(one["position_w"][0] - other["position_w"][0])),
        float(np.linalg.norm(one["velocity_w"][0] - other["velocity_w"][0])),
        2.0 * math.acos(min(1.0, share)) if math.isfinite(share) else math.nan,
    )
