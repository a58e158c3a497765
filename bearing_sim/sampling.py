"""The instants at which a sensor samples and its measurements arrive."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from fractions import Fraction
from typing import Generic, TypeVar

T = TypeVar("T")

SECOND_NS = 1_000_000_000


class SampleGrid:
    """Selector of the observations, at any rate, that are next after a sensor's sampling instants.

    A tolerance of a tenth of a period keeps jittered stamps at the sensor's own rate from being
    skipped; the grid does not drift, so the mean rate is exact.
    """

    def __init__(self) -> None:
        self._next_ns: int | None = None
        self._last_ns = 0

    def takes(self, stamp_ns: int, rate: float) -> bool:
        """Return whether the observation at `stamp_ns` is a sample of a sensor of `rate` Hz."""
        period = SECOND_NS / rate
        went_back = stamp_ns < self._last_ns - period
        self._last_ns = stamp_ns
        if self._next_ns is None or went_back or stamp_ns > self._next_ns + period:
            self._next_ns = stamp_ns
        if stamp_ns < self._next_ns - 0.1 * period:
            return False
        self._next_ns = round(self._next_ns + period)
        return True


class InstantGrid:
    """The instants k/rate on the clock of the stamps, to the nanosecond and without drift."""

    def __init__(self) -> None:
        self._rate = 0.0
        self._scale, self._per = 1, 1  # the k-th instant is at k · scale / per ns

    def between(self, after_ns: int, until_ns: int, rate: float) -> Iterator[int]:
        """Yield the instants in (after_ns, until_ns], in order; `rate` in Hz."""
        if rate != self._rate:
            exact = Fraction(rate).limit_denominator(1000)
            self._rate = rate
            self._scale, self._per = SECOND_NS * exact.denominator, exact.numerator
        k = after_ns * self._per // self._scale
        while (instant_ns := (k * self._scale + self._per // 2) // self._per) <= until_ns:
            if instant_ns > after_ns:
                yield instant_ns
            k += 1


class DelayLine(Generic[T]):
    """Measurements in transit, kept in order; a restart of the source loses those in transit."""

    def __init__(self) -> None:
        self._travelling: deque[tuple[int, T]] = deque()

    def put(self, due_ns: int, measurement: T) -> None:
        while self._travelling and self._travelling[-1][0] > due_ns + SECOND_NS:
            self._travelling.pop()
        self._travelling.append((due_ns, measurement))

    def due(self, now_ns: int) -> list[T]:
        """Return the measurements that have arrived by `now_ns`, in the order of sampling."""
        arrived: list[T] = []
        while self._travelling and self._travelling[0][0] <= now_ns:
            arrived.append(self._travelling.popleft()[1])
        return arrived

    @property
    def next_ns(self) -> int | None:
        """Return the arrival time of the next measurement; None when none is in transit."""
        return self._travelling[0][0] if self._travelling else None
