"""The instants at which a sensor samples and its measurements arrive, and its random numbers."""

from __future__ import annotations

import math
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


ALL = 0xFFFF_FFFF_FFFF_FFFF
STEP = 0x9E37_79B9_7F4A_7C15
"""Increment from one state of SplitMix64 to the next, in 64 bits."""
_UNIT = 2.0**-53


class Draws:
    """Uniform numbers of one stream: SplitMix64 (Steele et al., OOPSLA 2014), keyed by integers.

    They depend only on seed, instant and beacon, not on the frames before, on what is visible, or
    on the other beacons: the same seed and the same truth give the same bearings whatever the
    stamps of the poses.
    """

    __slots__ = ("_key", "_state")

    def __init__(self, *key: int, of: Draws | None = None) -> None:
        """Begin the stream of a key, which continues that `of` another one."""
        state: int = 0 if of is None else of._key
        for part in key:
            state = splitmix64((state ^ part) + STEP & ALL)
        self._key: int = state
        self._state = state

    def uniform(self) -> float:
        """Return the next number, in (0, 1]."""
        return ((self.whole() >> 11) + 1) * _UNIT

    def whole(self) -> int:
        """Return the next number, a word of 64 bits."""
        self._state = self._state + STEP & ALL
        return splitmix64(self._state)


def splitmix64(z: int) -> int:
    """Return the word that SplitMix64 derives from a state."""
    z = ((z ^ z >> 30) * 0xBF58_476D_1CE4_E5B9) & ALL
    z = ((z ^ z >> 27) * 0x94D0_49BB_1331_11EB) & ALL
    return z ^ z >> 31


def pair(draws: Draws, degrees_of_freedom: float) -> tuple[float, float]:
    """Return two numbers of unit standard deviation, isotropic in their plane.

    Independent N(0, 1) when `degrees_of_freedom` is infinite (Box and Muller, 1958). Otherwise,
    above 2, the bivariate Student t scaled to unit variance: each number is
    t_ν √((ν − 2)/ν), and both are large together, as for an outlier of a direction. Its radius
    √(ν (u^(−2/ν) − 1)) tends to the Gaussian's √(−2 ln u).
    """
    u, angle = draws.uniform(), 2.0 * math.pi * draws.uniform()
    if math.isinf(degrees_of_freedom):
        radius = math.sqrt(-2.0 * math.log(u))
    else:
        grown = math.expm1(-2.0 / degrees_of_freedom * math.log(u))
        radius = math.sqrt((degrees_of_freedom - 2.0) * grown)
    return radius * math.cos(angle), radius * math.sin(angle)


def hidden(seed: int, beacon_id: int, stamp_ns: int, share: float, spell_ns: int) -> bool:
    """Return whether a beacon is hidden at an instant, by the process of `spell_begin`."""
    return spell_begin(seed, beacon_id, stamp_ns, share, spell_ns) is not None


def spell_begin(seed: int, stream: int, stamp_ns: int, share: float, spell_ns: int) -> int | None:
    """Return the beginning, in ns, of the random spell that an instant is in, None outside of all.

    Spells of `spell_ns` fill `share` of the time: time is divided into periods of spell/share,
    shifted for each stream, with one spell at a random position in each; two spells may adjoin.
    """
    if share <= 0.0:
        return None
    period_ns = max(spell_ns, round(spell_ns / share))
    shift = int(Draws(seed, stream, 1).uniform() * period_ns)
    number, into = divmod(stamp_ns + shift, period_ns)
    begin = Draws(seed, stream, 2, number).uniform() * (period_ns - spell_ns)
    return stamp_ns - into + round(begin) if begin <= into < begin + spell_ns else None
