"""Stamps of the samples of a Crazyflie, from its milliseconds and their arrival."""

from __future__ import annotations

WRAP_MS = 1 << 24
MS = 1_000_000
DRIFT = 1e-4
"""Largest difference of the two clocks' speeds."""


class RadioStamps:
    """Conversion of the board's 24-bit milliseconds to the vehicle's clock.

    A packet can only come late, so the newest of the least delays is the clocks' difference, to
    which half the shortest round trip of a request is added. It follows the drift of the clocks.

    Attributes:
        backward: number of times that were before the last one; a link keeps the order of packets.
    """

    def __init__(self) -> None:
        self.backward = 0
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
        self.backward += last_ms is not None and elapsed_ms < last_ms
        delay_ns = now_ns - MS * elapsed_ms
        allowed_ns = self._offset_ns + DRIFT * (now_ns - self._arrived_ns)
        is_new = last_ms is None or abs(delay_ns - self._offset_ns) > 1000 * MS
        self._offset_ns = delay_ns if is_new else min(delay_ns, allowed_ns)
        self._elapsed_ms, self._arrived_ns = elapsed_ms, now_ns
        return round(MS * elapsed_ms + self._offset_ns - self._way_ns)


def _step(ms: int) -> int:
    """Return the shortest step, forward or back, that is this one modulo 2^24 ms."""
    return (ms + WRAP_MS // 2) % WRAP_MS - WRAP_MS // 2
