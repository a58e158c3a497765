"""Reports measurements that an estimator does not use because of their time, before it drifts.

A measurement beyond the gate is told by the estimator's own flag; one that is none is refused with
its reason. A clock that is off, or a link that is slow, shows here only.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from estimation.outcome import AHEAD_NS, Outcome

LOOK_EVERY_NS = 1_000_000_000
TELL_EVERY_NS = 10_000_000_000
REASONS = {
    Outcome.TOO_OLD: "older than it can go back to",
    Outcome.AHEAD: f"more than {1e-6 * AHEAD_NS:.0f} ms ahead of the IMU",
}


class UnusedMeasurements:
    """Reads the counts of one estimator once a second."""

    def __init__(self) -> None:
        self._looked_ns = self._told_ns = -(1 << 62)
        self._told: Counter[Outcome] = Counter()

    def look(self, name: str, estimator: object, now_ns: int) -> str | None:
        """Return what is to be reported of it, mostly None.

        Args:
            estimator: with counts `ignored` by Outcome; nothing is told of one without.
        """
        if now_ns - self._looked_ns < LOOK_EVERY_NS:
            return None
        self._looked_ns = now_ns
        counts: Mapping[Outcome, int] = getattr(estimator, "ignored", {})
        found = Counter({outcome: counts.get(outcome, 0) for outcome in REASONS})
        if any(found[outcome] < self._told[outcome] for outcome in REASONS):  # it was reset
            self._told = Counter()
        new = found - self._told
        if not new or now_ns - self._told_ns < TELL_EVERY_NS:
            return None
        self._told_ns, self._told = now_ns, found
        each = ", ".join(f"{count} {REASONS[outcome]}" for outcome, count in sorted(new.items()))
        return f"{name} did not use {new.total()} measurements: {each}"
