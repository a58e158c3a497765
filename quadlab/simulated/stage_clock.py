"""A clock for the processor time of each stage of a simulated flight."""

from __future__ import annotations

import time
from collections.abc import Callable

EVERY = 7
"""One tick in so many is timed, and counts for all: reading clocks would take 3 % of a flight.
Coprime to the periods of the flight (5 ticks a pose, 100 a batch of the log), so each has its
share."""


class StageClock:
    """Seconds by stage; it only reads the time, so it changes no message."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = 0.0
        self._ticks = 0

    def begin(self) -> Callable[[str], None]:
        """Begin a tick; return a function to call with the name of each stage when it has ended.

        The time between two ticks belongs to no stage.
        """
        self._ticks += 1
        if self._ticks % EVERY:
            return _ignore
        self._last = time.perf_counter()
        return self._lap

    def _lap(self, stage: str) -> None:
        spent = EVERY * (time.perf_counter() - self._last)
        self.seconds[stage] = self.seconds.get(stage, 0.0) + spent
        self._last = time.perf_counter()


def _ignore(stage: str) -> None:
    """Ignore the stages of a tick that is not timed."""
