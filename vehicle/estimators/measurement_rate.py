"""The rate at which measurements really come, so that gains made for another rate are reported."""

from __future__ import annotations

WINDOW_NS = 2_000_000_000
CHANGE = 0.1
"""Share by which a rate must differ from the last one told to be worth another look."""


class MeasurementRate:
    """Counts measurements over windows of 2 s and remembers what was said about them."""

    def __init__(self) -> None:
        self._began_ns = 0
        self._count = 0
        self._told = 0.0
        self._said: set[str] = set()

    def add(self, now_ns: int) -> float | None:
        """Count one taken at `now_ns`; at the end of a window return the rate (Hz), when it is
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
        if abs(rate - self._told) < CHANGE * self._told:
            return None
        self._told = rate
        return rate

    def unsaid(self, lines: list[str]) -> list[str]:
        """Return the lines whose subject, their first word, was not reported since the last change
        of gains.
        """
        new = [line for line in lines if line.split()[0] not in self._said]
        self._said.update(line.split()[0] for line in new)
        return new

    def forget_warnings(self) -> None:
        """Forget the warnings after a change of gains: those that hold of the new ones are reported
        again.
        """
        self._said.clear()
        self._told = 0.0
