"""Outages of the link to the vehicle: their number and duration."""

from __future__ import annotations

from dataclasses import dataclass

from vehicle_link.transport.heartbeat import DEGRADED_AFTER

_SHORTEST_NS = round(DEGRADED_AFTER * 1e9)


@dataclass(frozen=True, slots=True)
class OutageFigures:
    """The outages since the vehicle was first received, including a present one. Lengths in s."""

    count: int = 0
    last: float = 0.0
    longest: float = 0.0
    total: float = 0.0

    def with_one(self, length: float) -> OutageFigures:
        longest = max(self.longest, length)
        return OutageFigures(self.count + 1, length, longest, self.total + length)


class Outages:
    """Counts outages: silences of at least DEGRADED_AFTER between two messages.

    One thread writes, any may read: values are replaced, never changed in place. Times are of any
    steady clock.
    """

    def __init__(self, started_ns: int) -> None:
        self._received_ns: int | None = None
        self._good_since_ns = started_ns
        self._ended = OutageFigures()

    def note_received(self, now_ns: int) -> None:
        """Note that the vehicle was received."""
        length_ns = self._silence_ns(now_ns)
        if self._received_ns is None or length_ns >= _SHORTEST_NS:
            self._good_since_ns = now_ns
        if length_ns >= _SHORTEST_NS:
            self._ended = self._ended.with_one(length_ns * 1e-9)
        if self._received_ns is None or now_ns > self._received_ns:
            self._received_ns = now_ns

    def figures(self, now_ns: int) -> OutageFigures:
        length_ns = self._silence_ns(now_ns)
        return self._ended.with_one(length_ns * 1e-9) if length_ns >= _SHORTEST_NS else self._ended

    def state_duration(self, now_ns: int) -> float:
        """Return the seconds since the link became good; while it is not, the seconds since the
        last message, or since the start when there was none.
        """
        since_ns = self._good_since_ns
        if self._received_ns is not None and self._silence_ns(now_ns) >= _SHORTEST_NS:
            since_ns = self._received_ns
        return max(0, now_ns - since_ns) * 1e-9

    def _silence_ns(self, now_ns: int) -> int:
        return 0 if self._received_ns is None else now_ns - self._received_ns
