"""Reports on measurements: their rate, those that cannot be used, and those that are ignored.

Gains may be designed for another rate. A measurement beyond the gate is reported by the estimator's
own flag, and an invalid one is refused with its reason; a wrong clock or a slow link is only
visible in the counts of ignored ones, before the estimate drifts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping

from estimation.estimator import Estimator
from estimation.outcome import AHEAD_NS, Outcome
from vehicle import mailbox

WINDOW_NS = 2_000_000_000
CHANGE = 0.1
"""Relative difference from the last reported rate that counts as new."""
WARN_NS = 1_000_000_000
"""Least time between two lines about unusable measurements, of which 30 a second may arrive."""
CHECK_EVERY_NS = 1_000_000_000
REPORT_EVERY_NS = 10_000_000_000
REASONS = {
    Outcome.TOO_OLD: "older than it can go back to",
    Outcome.AHEAD: f"more than {1e-6 * AHEAD_NS:.0f} ms ahead of the IMU",
}


class MeasurementReports:
    """Reports on the measurements of one vehicle.

    Args:
        say: called with a line for the log and its level.
    """

    def __init__(self, say: Callable[[str, int], None]) -> None:
        self._say = say
        self._began_ns = 0
        self._count = 0
        self._warned_ns = -(1 << 62)
        self.restart()

    def restart(self) -> None:
        """Begin again after a change of gains: warnings that apply to the new ones are repeated."""
        self._reported: set[str] = set()
        self._reported_rate = 0.0

    def used(self, now_ns: int, estimator: Estimator) -> None:
        """Count a measurement that the estimator in use has used."""
        rate = self._rate(now_ns)
        if rate is not None:
            self._once(estimator.warnings(rate))

    def unusable(self, line: str, now_ns: int) -> None:
        """Report why a measurement cannot be used."""
        if now_ns - self._warned_ns > WARN_NS:
            self._warned_ns = now_ns
            self._say(line, mailbox.WARN)

    def unknown_beacons(self, ids: list[int], known: object) -> None:
        """Report a frame of bearings in which no beacon is known."""
        self._once([f"no known beacon among {ids}; known are {known}"])

    def _once(self, lines: list[str]) -> None:
        """Report the lines whose subject, their first word, was not reported before."""
        new = [line for line in lines if line.split()[0] not in self._reported]
        self._reported.update(line.split()[0] for line in new)
        for line in new:
            self._say(line, mailbox.WARN)

    def _rate(self, now_ns: int) -> float | None:
        """Return the rate (Hz) at the end of a window of 2 s, if it is new."""
        elapsed_ns = now_ns - self._began_ns
        if self._began_ns == 0 or elapsed_ns > 2 * WINDOW_NS:  # the first, or after a pause
            self._began_ns, self._count = now_ns, 0
            return None
        self._count += 1
        if elapsed_ns < WINDOW_NS:
            return None
        rate = 1e9 * self._count / elapsed_ns
        self._began_ns, self._count = now_ns, 0
        if abs(rate - self._reported_rate) < CHANGE * self._reported_rate:
            return None
        self._reported_rate = rate
        return rate


class UnusedMeasurements:
    """Reads the counts of one estimator once a second."""

    def __init__(self) -> None:
        self._checked_ns = self._reported_ns = -(1 << 62)
        self._reported: Counter[Outcome] = Counter()

    def check(self, name: object, estimator: object, now_ns: int) -> str | None:
        """Return a line about newly ignored measurements, usually None.

        Args:
            estimator: one with counts `ignored` by Outcome; another one is skipped.
        """
        if now_ns - self._checked_ns < CHECK_EVERY_NS:
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
