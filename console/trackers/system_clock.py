"""The clock of a tracking system, mapped onto the host's steady clock.

A stamp arrives later than it was taken, by a delay that varies. The smallest delay indicates the
offset of the clocks best; its own size cannot be measured here.
"""

from __future__ import annotations

from collections import deque

SECOND_NS = 1_000_000_000
WINDOW = 30
"""Number of past seconds used; of each, the smallest delay is stored."""
ENOUGH = 8
"""Number of seconds before a drift is estimated."""
DRIFT_MAX = 500e-6
"""Largest drift, s/s; quartz is ten times better."""
JUMP_NS = 100_000_000
AGREE = 5
AGREEMENT_NS = 10_000_000
"""Stamps that are off by more than JUMP_NS, AGREE in a row and all within AGREEMENT_NS, come from a
clock that was set. After a network outage their delays would decrease instead."""


class SystemClock:
    """Maps stamps of a system's clock onto the host's.

    Attributes:
        drift: s/s by which the system's clock is slower than ours.
        jump_ns: size of its last jump, forwards positive.
        jumps: how often it was set.
    """

    def __init__(self) -> None:
        self.drift, self.jump_ns, self.jumps = 0.0, 0, 0
        self._least: deque[tuple[int, int]] = deque(maxlen=WINDOW)  # received, delay
        self._suspects: deque[int] = deque(maxlen=AGREE)

    def host_ns(self, stamp_ns: int, received_ns: int) -> int | None:
        """Return the stamp on the host's clock; None while the system's clock may have been set."""
        delay = received_ns - stamp_ns
        if self._least and abs(off := delay - self._offset(received_ns)) > JUMP_NS:
            self._suspects.append(delay)
            alike = max(self._suspects) - min(self._suspects) < AGREEMENT_NS
            if len(self._suspects) < AGREE or not alike:
                return None
            self.jumps, self.jump_ns, self.drift = self.jumps + 1, -off, 0.0
            self._least.clear()
        self._suspects.clear()
        self._note(delay, received_ns)
        return stamp_ns + self._offset(received_ns)

    def _note(self, delay: int, received_ns: int) -> None:
        if not self._least or received_ns // SECOND_NS > self._least[-1][0] // SECOND_NS:
            self._find_drift()
            self._least.append((received_ns, delay))
        elif delay < self._least[-1][1]:
            self._least[-1] = received_ns, delay

    def _offset(self, now_ns: int) -> int:
        return min(delay + round(self.drift * (now_ns - at)) for at, delay in self._least)

    def _find_drift(self) -> None:
        """Fit a line to the smallest delays by least squares."""
        if len(self._least) < ENOUGH:
            return
        begin, first = self._least[0]
        times = [at - begin for at, _ in self._least]
        delays = [delay - first for _, delay in self._least]
        mean, middle = sum(times) / len(times), sum(delays) / len(delays)
        spread = sum((t - mean) ** 2 for t in times)
        slope = sum((t - mean) * (d - middle) for t, d in zip(times, delays, strict=True)) / spread
        self.drift = max(-DRIFT_MAX, min(DRIFT_MAX, slope))
