"""Reports measurements that an estimator ignores because of their time, before it drifts.

A measurement beyond the gate is reported by the estimator's own flag, and an invalid one is refused
with its reason. A wrong clock or a slow link is only visible here.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from estimation.outcome import AHEAD_NS, Outcome

LOOK_EVERY_NS = 1_000_000_000
REPORT_EVERY_NS = 10_000_000_000
REASONS = {
    Outcome.TOO_OLD: "older than it can go back to",
    Outcome.AHEAD: f"more than {1e-6 * AHEAD_NS:.0f} ms ahead of the IMU",
}


class UnusedMeasurements:
    """Reads the counts of one estimator once a second."""

    def __init__(self) -> None:
        self._checked_ns = self._reported_ns = -(1 << 62)
        self._reported: Counter[Outcome] = Counter()

    def look(self, name: str, estimator: object, now_ns: int) -> str | None:
        """Return a line about newly ignored measurements, usually None.

        Args:
            estimator: one with counts `ignored` by Outcome; another one is skipped.
        """
        if now_ns - self._checked_ns < LOOK_EVERY_NS:
            return None
        self._checked_ns = now_ns
        counts: Mapping[Outcome, int] = getattr(estimator, "ignored", {})
        found = Counter({outcome: counts.get(outcome, 0) for outcome in REASONS})
        if any(found[outcome] < self._reported[outcome] for outcome in REASONS):  # it was reset
            self._reported = Counter()
        new = found - self._reported
        if not new or now_ns - self._reported_ns < REPORT_EVERY_NS:
            return None
        self._reported_ns, self._reported = now_ns, found
        each = ", ".join(f"{count} {REASONS[outcome]}" for outcome, count in sorted(new.items()))
        return f"{name} did not use {new.total()} measurements: {each}"
