"""The number of questions under way at a time: as many as the link carries side by side.

By Little's law twice as many bring twice as much only while each is answered as soon as before;
on a full link each takes twice as long, telemetry waits behind them, and nothing is gained. So the
number is doubled, and kept only where the median round trip stays below GAINS of what it was. From
time to time, and when answers become slow, it is found again from one on, for a vehicle flies away
and comes back.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from statistics import median

MOST = 16
GAINS = 1.4
"""Least gain that counts; a doubling brings 1.43 times as much, or more."""
ROUND = 8
"""Answers of which the median is taken, at least."""
SLOW = 2.0
"""Times the round trip that was found, beyond which the link has got narrower."""
HOLD = 60.0
"""s until it is found again: on a narrow link telemetry waits some 0.2 s of them."""


class Window:
    """Any thread may tell and ask.

    Attributes:
        size: questions that may be in the air.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self.size = 1
        self._trips: list[float] = []
        self._below: float | None = None
        """s, the median round trip of half as many; None where nothing is compared."""
        self._settled = 0.0
        """s, the median round trip at the size that was found."""
        self._settled_until: float | None = None
        """None while it is being found."""

    def answered(self, size: int, seconds: float) -> None:
        """Note how long a question took that was asked while this was the size."""
        with self._lock:
            if size != self.size:
                return
            self._trips.append(seconds)
            if len(self._trips) >= max(ROUND, size):
                trip = median(self._trips)
                self._trips = []
                if self._settled_until is None:
                    self._climb(trip)
                else:
                    self._watch(trip)

    def _climb(self, trip: float) -> None:
        if self._below is not None and trip > GAINS * self._below:
            self.size //= 2
            trip = self._below
        elif self.size < MOST:
            self.size *= 2
            self._below = trip
            return
        self._settled, self._settled_until = trip, self._clock() + HOLD

    def _watch(self, trip: float) -> None:
        """Watch for a link that got narrower: answers slower than when the window was settled."""
        assert self._settled_until is not None
        is_slow = self.size > 1 and trip > SLOW * self._settled
        if is_slow or self._clock() >= self._settled_until:
            self.size, self._below, self._settled_until = 1, None, None
