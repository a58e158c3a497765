"""Measures the rate of measurements, so that gains designed for another rate are reported."""

from __future__ import annotations

WINDOW_NS = 2_000_000_000
CHANGE = 0.1
"""Relative difference from the last reported rate that counts as new."""


class MeasurementRate:
    """Counts measurements over windows of 2 s and remembers which warnings were reported."""

    def __init__(self) -> None:
        self._began_ns = 0
        self._count = 0
        self._reported = 0.0
        self._said: set[str] = set()

    def add(self, now_ns: int) -> float | None:
        """Count a measurement at `now_ns`; at the end of a window return the rate (Hz), if it is
        new.
        """
        elapsed_ns = now_ns - self._began_ns
        if self._began_ns == 0 or elapsed_ns > 2 * WINDOW_NS:  # the first, or after a pause
            self._began_ns, self._count = now_ns, 0
            return None
        self._count += 1
        if elapsed_ns < WINDOW_NS:
            return None
        rate = 1e9 * self._count / elapsed_ns
        self._began_ns, self._count = now_ns, 0
        if abs(rate - self._reported) < CHANGE * self._reported:
            return None
        self._reported = rate
        return rate

    def unsaid(self, lines: list[str]) -> list[str]:
        """Return the lines whose subject, their first word, was not reported since the last change
        of gains.
        """
        new = [line for line in lines if line.split()[0] not in self._said]
        self._said.update(line.split()[0] for line in new)
        return new

    def forget_warnings(self) -> None:
        """Clear the warnings after a change of gains: those that apply to the new ones are reported
        again.
        """
        self._said.clear()
        self._reported = 0.0
