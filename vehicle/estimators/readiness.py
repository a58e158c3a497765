"""The judgement whether an estimator in parallel may take over from the one in use."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

from estimation.convergence import Difference, difference
from quadrotor.records import Record
from vehicle.estimators.estimator_runner import POSES, Runner

AGREEMENT = Difference(position=0.25, velocity=0.4, attitude=math.radians(6.0))
"""Largest difference between an estimate and the one in use for a hand-over in flight."""
PERIOD_NS = 100_000_000
"""Time in ns between two judgements of the shadow."""


class Lack(IntEnum):
    """The condition that an estimator lacks to be flown on, also its number in STATUS records."""

    SHADOW = 0
    """no estimator runs in parallel"""
    MEASUREMENTS = 1
    """it has no start, or no measurement in time"""
    CONVERGENCE = 2
    AGREEMENT = 3
    """it is too far from the estimate in use"""
    NOTHING = 4


@dataclass(frozen=True, slots=True)
class Readiness:
    """The judgement of an estimator in parallel.

    Attributes:
        reason: why it may not be flown on, with numbers; empty when it may.
        share: of the way there, 0 to 1.
        distance: m, from the position of the estimate in use.
    """

    lack: Lack
    reason: str
    share: float
    distance: float


def readiness(successor: Runner, active: Runner, state: Record) -> Readiness:
    """Return whether one may take over from `active`, whose STATE (1,) is `state`."""
    estimator, convergence = successor.estimator, successor.estimator.convergence
    apart = difference(successor.state, state)
    if not convergence.reached:
        lack, hint = Lack.CONVERGENCE, ""
        if not estimator.initialized or estimator.stale:
            lack = Lack.MEASUREMENTS
        if estimator.initialized and estimator.stale:
            hint = "; late ones need a longer estimation.measurement_timeout"
        reason = f"estimator {successor} has not converged: {convergence.reason}{hint}"
        return Readiness(lack, reason, convergence.share, apart.position)
    # A change back to the tracker is never refused for a difference.
    if apart.within(AGREEMENT) or successor.source == POSES != active.source:
        return Readiness(Lack.NOTHING, "", 1.0, apart.position)
    reason = f"estimator {successor} is {apart} away from {active}; allowed {AGREEMENT}"
    return Readiness(Lack.AGREEMENT, reason, AGREEMENT.share_of(apart), apart.position)


class ShadowWatch:
    """Judges the shadow ten times a second, so that operators see it converge.

    Attributes:
        status: numbers of the STATUS record's `shadow_` fields, in their order.
    """

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Begin again: no estimator runs in parallel, or another one."""
        self._due_ns = self._ready_ns = 0
        self.status = (int(Lack.SHADOW), 0.0, 0.0, math.nan, math.nan)

    def step(self, now_ns: int, shadow: Runner, active: Runner, state: Record) -> None:
        """Judge the shadow when that is due; see `readiness`."""
        if now_ns < self._due_ns:
            return
        self._due_ns = now_ns + PERIOD_NS
        ready = readiness(shadow, active, state)
        if ready.lack is not Lack.NOTHING:
            self._ready_ns = 0
        elif not self._ready_ns:
            self._ready_ns = now_ns
        lasted = 1e-9 * (now_ns - self._ready_ns) if self._ready_ns else 0.0
        deviations = shadow.estimator.deviations
        sigma = math.nan if deviations is None else deviations.position
        self.status = (int(ready.lack), ready.share, lasted, sigma, ready.distance)
