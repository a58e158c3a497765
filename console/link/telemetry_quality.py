"""Rate, loss and jitter of telemetry over the last two seconds."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

WINDOW_NS = 2_000_000_000
RESTART, RESTART_NS = 1000, 5_000_000_000
"""Packets, and ns; a sequence or stamp that goes back by more belongs to a restarted vehicle."""


@dataclass(frozen=True, slots=True)
class TelemetryQuality:
    """Figures for link_status."""

    rate: float  # packets a second
    loss: float  # share that did not arrive, 0..1
    jitter: float  # s, standard deviation of the transit time


class TelemetryWindow:
    """The packets of the last two seconds; times in ns. `now_ns` is of a steady clock, because the
    system's clock may be set.

    Any clocks may have made the stamp and `received_ns`.
    """

    def __init__(self) -> None:
        self._packets: deque[tuple[int, int, int]] = deque()  # sequence, now, transit time
        self.newest_stamp_ns: int | None = None

    def feed(self, sequence: int, stamp_ns: int, received_ns: int, now_ns: int) -> bool:
        """Add one packet with the stamp of its newest sample; return False when a newer one arrived
        before.
        """
        packets = self._packets
        sequence_back = bool(packets) and sequence < packets[-1][0] - RESTART
        newest_ns = self.newest_stamp_ns
        if sequence_back or (newest_ns is not None and stamp_ns < newest_ns - RESTART_NS):
            packets.clear()
            self.newest_stamp_ns = None
        packets.append((sequence, now_ns, received_ns - stamp_ns))
        self._forget(now_ns)
        newest = self.newest_stamp_ns is None or stamp_ns > self.newest_stamp_ns
        if newest:
            self.newest_stamp_ns = stamp_ns
        return newest

    def quality(self, now_ns: int) -> TelemetryQuality:
        """Return the figures of the last two seconds."""
        self._forget(now_ns)
        packets = list(self._packets)
        if not packets:
            return TelemetryQuality(0.0, 0.0, 0.0)
        sequences = {sequence for sequence, _, _ in packets}
        expected = max(sequences) - min(sequences) + 1
        under_way = [way for _, _, way in packets]
        mean = sum(under_way) / len(under_way)
        variance = sum((way - mean) ** 2 for way in under_way) / len(under_way)
        return TelemetryQuality(
            rate=len(packets) / (WINDOW_NS * 1e-9),
            loss=1.0 - len(sequences) / expected,
            jitter=math.sqrt(variance) * 1e-9,
        )

    def _forget(self, now_ns: int) -> None:
        while self._packets and self._packets[0][1] < now_ns - WINDOW_NS:
            self._packets.popleft()
