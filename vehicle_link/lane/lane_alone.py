"""The time for which one end has heard the other by the lane alone, and nothing over Zenoh.

Commands come over Zenoh, which receives in threads of its own. If one of these ends (a callback
without memory ends it), the process still sends everything and receives by the lane: nobody would
notice, and no command would be heard. Heartbeats use both ways. While they come by the lane, those
over Zenoh must come too; if not, neither do commands.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from vehicle_link import clock

SILENT_AFTER = 0.5
"""Seconds between two messages by the lane that were an outage of the whole link: Zenoh, which
takes longer to come back, is given its time anew."""


class LaneAlone:
    """Watch of the two ways from one other end; any thread may call it.

    Args:
        now: the flight's steady clock, s.
    """

    def __init__(self, now: Callable[[], float] = clock.monotonic) -> None:
        self._now = now
        self._sender = b""
        self._by_lane, self._heard = -math.inf, 0.0

    def by_lane(self, sender: bytes = b"") -> None:
        """Note a message by the lane; one of another sender than before begins anew."""
        now = self._now()
        if sender != self._sender or now - self._by_lane > SILENT_AFTER:
            self._sender, self._heard = sender, now
        self._by_lane = now

    def by_zenoh(self, sender: bytes = b"") -> None:
        """Note a message over Zenoh; that of another sender than the lane's does not count."""
        if sender == self._sender:
            self._heard = self._now()

    @property
    def lasted(self) -> float:
        """Return for how many seconds only the lane has delivered."""
        return max(0.0, self._by_lane - self._heard)
