"""The convergence of an estimate that may be flown on, and the difference of two estimates."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from quadrotor.records import Record


@dataclass(frozen=True, slots=True)
class Convergence:
    """The judgement whether an estimator may be flown on, and its `reason` with numbers."""

    reached: bool
    reason: str


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
        return (
            f"{self.position:.3f} m, {self.velocity:.3f} m/s, {math.degrees(self.attitude):.2f} deg"
        )

    def within(self, other: Difference) -> bool:
        """Return whether each part is at most the other's; False for NaN."""
        return (
            self.position <= other.position
            and self.velocity <= other.velocity
            and self.attitude <= other.attitude
        )


def difference(one: Record, other: Record) -> Difference:
    """Return the difference between two STATE records of shape (1,)."""
    share = abs(float(one["quaternion_wb"][0] @ other["quaternion_wb"][0]))
    return Difference(
        float(np.linalg.norm(one["position_w"][0] - other["position_w"][0])),
        float(np.linalg.norm(one["velocity_w"][0] - other["velocity_w"][0])),
        2.0 * math.acos(min(1.0, share)) if math.isfinite(share) else math.nan,
    )
