"""The state of the link, by when the other end was last received. Pure: times are arguments."""

from __future__ import annotations

from enum import StrEnum

HEARTBEAT_RATE = 20.0  # Hz
DEGRADED_AFTER = 0.2  # s
LOST_AFTER = 1.0  # s
LINK_HEARTBEAT_EVERY = 2
"""Where several vehicles share a computer, the number of heartbeats carried by a connected lane of
which one is also sent over the link: enough to know that it works."""


class LinkState(StrEnum):
    GOOD = "good"
    DEGRADED = "degraded"
    LOST = "lost"


class HeartbeatMonitor:
    """Monitor of the link by the time since the last sign of life; lost before the first.

    Args:
        degraded_after, lost_after: seconds without a sign of life.
    """

    def __init__(
        self, degraded_after: float = DEGRADED_AFTER, lost_after: float = LOST_AFTER
    ) -> None:
        self._degraded_ns = round(degraded_after * 1e9)
        self._lost_ns = round(lost_after * 1e9)
        self._received_ns: int | None = None

    def note_received(self, now_ns: int) -> None:
        """Note a sign of life at this time of any steady clock."""
        if self._received_ns is None or now_ns > self._received_ns:
            self._received_ns = now_ns

    def age(self, now_ns: int) -> float:
        """Return the seconds since the last heartbeat; inf before the first."""
        return float("inf") if self._received_ns is None else (now_ns - self._received_ns) * 1e-9

    def state(self, now_ns: int) -> LinkState:
        if self._received_ns is None or now_ns - self._received_ns >= self._lost_ns:
            return LinkState.LOST
        if now_ns - self._received_ns >= self._degraded_ns:
            return LinkState.DEGRADED
        return LinkState.GOOD
