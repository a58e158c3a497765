"""The number of requests in flight: as many as the link carries in parallel.

By Little's law twice as many requests bring twice as much only while each is answered as fast as
before; on a full link each takes twice as long, telemetry queues behind them, and nothing is
gained. The number is therefore doubled, and kept only if the median round trip stays below
LARGEST_RATIO times its previous value. From time to time, and when answers become slow, it is
determined again, starting from one, because a vehicle flies away and returns.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from statistics import median

MAX_REQUESTS = 16
LARGEST_RATIO = 1.4
"""Largest ratio of round trips for a doubling to be kept; it then brings 1.43 times as much, or
more."""
ANSWERS_MIN = 8
"""Minimum number of answers for a median."""
SLOW = 2.0
"""Ratio to the settled round trip above which the link has become narrower."""
HOLD = 60.0
"""Seconds until the number is determined again: on a narrow link telemetry waits for some 0.2 s of
them."""


class RequestWindow:
    """Determines the number of requests in flight; thread-safe.

    Attributes:
        size: largest number of requests in flight.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self.size = 1
        self._trips: list[float] = []
        self._below: float | None = None
        """Median round trip with half as many, s; None when there is no comparison."""
        self._settled = 0.0
        """Median round trip at the settled size, s."""
        self._settled_until: float | None = None
        """Time until which the size is settled; None while it is being determined."""

    def answered(self, size: int, seconds: float) -> None:
        """Note the duration of a request that was sent at this size."""
        with self._lock:
            if size != self.size:
                return
            self._trips.append(seconds)
            if len(self._trips) >= max(ANSWERS_MIN, size):
                trip = median(self._trips)
                self._trips = []
                if self._settled_until is None:
                    self._climb(trip)
                else:
                    self._watch(trip)

    def _climb(self, trip: float) -> None:
        if self._below is not None and trip > LARGEST_RATIO * self._below:
            self.size //= 2
            trip = self._below
        elif self.size < MAX_REQUESTS:
            self.size *= 2
            self._below = trip
            return
        self._settled, self._settled_until = trip, self._clock() + HOLD

    def _watch(self, trip: float) -> None:
        """Watch for a link that has become narrower: answers slower than when the
        window settled.
        """
        assert self._settled_until is not None
        is_slow = self.size > 1 and trip > SLOW * self._settled
        if is_slow or self._clock() >= self._settled_until:
            self.size, self._below, self._settled_until = 1, None, None
