"""Whether commands could still reach this process: they come over Zenoh alone.

Zenoh receives in a thread of its own. If that one ends (a callback without memory ends it), the
process still sends everything and receives by the lane: nobody would notice, and no command would
be heard. The station's heartbeats use both ways. While they come by the lane, those over Zenoh must
come too; if not, neither do commands.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from vehicle_link import clock

DEAF_AFTER = 2.0
"""Seconds of heartbeats by the lane alone after which this process counts as deaf."""
SILENT_AFTER = 0.5
"""Seconds between two heartbeats by the lane that were an outage of the whole link: Zenoh, which
takes longer to come back, is given its time anew."""


class CommandPath:
    """Watch of the heartbeats of the station that holds the vehicle; any thread may call it.

    Args:
        now: the flight's steady clock, s.
    """

    def __init__(self, now: Callable[[], float] = clock.monotonic) -> None:
        self._now = now
        self._publisher = b""
        self._by_lane = self._heard = -math.inf

    def by_lane(self, publisher: bytes) -> None:
        """Note a heartbeat by the lane from the publisher with this GID."""
        now = self._now()
        if publisher != self._publisher or now - self._by_lane > SILENT_AFTER:
            self._publisher, self._heard = publisher, now
        self._by_lane = now

    def by_zenoh(self, publisher: bytes) -> None:
        """Note a heartbeat over Zenoh from the publisher with this GID."""
        if publisher == self._publisher:
            self._heard = self._now()

    @property
    def is_deaf(self) -> bool:
        """Return whether only the lane has delivered heartbeats for DEAF_AFTER seconds."""
        return self._by_lane - self._heard > DEAF_AFTER
