"""Stamps of the samples of a Crazyflie, from its milliseconds and their arrival."""

from __future__ import annotations

import math

WRAP_MS = 1 << 24
MS = 1_000_000
DRIFT = 1e-4
"""Largest difference of the two clocks' speeds."""
TWICE, TWICE_S = 5, 2.0
"""Number of times that jump back, and the seconds within which they do, from which two Crazyflies
answer at one address: a restart causes one jump."""


class RadioStamps:
    """Conversion of the board's 24-bit milliseconds to the vehicle's clock.

    A packet can only come late, so the newest of the least delays is the clocks' difference, to
    which half the shortest round trip of a request is added. It follows the drift of the clocks.
    """

    def __init__(self) -> None:
        self._backward = 0  # times before the last one: a link keeps the order of packets
        self._watched_s, self._before, self._is_double = -math.inf, 0, False
        self._elapsed_ms: int | None = None
        self._offset_ns = 0.0
        self._way_ns = 0.0
        self._arrived_ns = 0

    def note_round_trip(self, duration_ns: int) -> None:
        """Note how long a request and its answer took."""
        way_ns = 0.5 * duration_ns
        self._way_ns = min(self._way_ns, way_ns) if self._way_ns else way_ns

    def stamp_ns(self, ms: int, now_ns: int) -> int:
        """Return when the sample with this time, modulo 2^24 ms, was taken."""
        last_ms = self._elapsed_ms
        elapsed_ms = ms if last_ms is None else last_ms + _step(ms - last_ms)
        self._backward += last_ms is not None and elapsed_ms < last_ms
        delay_ns = now_ns - MS * elapsed_ms
        allowed_ns = self._offset_ns + DRIFT * (now_ns - self._arrived_ns)
        is_new = last_ms is None or abs(delay_ns - self._offset_ns) > 1000 * MS
        self._offset_ns = delay_ns if is_new else min(delay_ns, allowed_ns)
        self._elapsed_ms, self._arrived_ns = elapsed_ms, now_ns
        return round(MS * elapsed_ms + self._offset_ns - self._way_ns)

    def is_double(self, now_s: float) -> bool:
        """Return whether two Crazyflies answer at one address: their times jump to and fro."""
        if now_s - self._watched_s >= TWICE_S:
            self._is_double = self._backward - self._before >= TWICE
            self._watched_s, self._before = now_s, self._backward
        return self._is_double


def _step(ms: int) -> int:
    """Return the shortest step, forward or back, that is this one modulo 2^24 ms."""
    return (ms + WRAP_MS // 2) % WRAP_MS - WRAP_MS // 2
