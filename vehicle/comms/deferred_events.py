"""Publish warnings from while no station was connected, once one is connected again.

Warnings at such a moment reach the vehicle's log and terminal, but not a station: the link is lost,
or the station was not running.
"""

from __future__ import annotations

import math
from collections import deque

from vehicle import mailbox
from vehicle_link.commands import EventKind
from vehicle_link.topics.status import DELAYED_PREFIX

CAPACITY = 8
"""Largest number of warnings that are published; the newest are kept."""
SILENT_AFTER = 0.3
"""Seconds without a station after which events may not be received."""
CONNECTED_FOR = 3.0
"""Seconds with a station after which its clients have reconnected."""


class DeferredEvents:
    """Queue of warnings that no station received. Used by one thread; times in s, monotonic."""

    def __init__(self) -> None:
        self._waiting: deque[mailbox.Event] = deque(maxlen=CAPACITY)
        self._connected_since = math.inf

    def defer(self, event: mailbox.Event, silence: float) -> bool:
        """Store the event if it is a warning that may not be received; return whether it is stored.

        Args:
            silence: s since the last message of the station; inf before the first.
        """
        is_deferred = event.level >= mailbox.WARN and SILENT_AFTER < silence < math.inf
        if is_deferred:
            self._waiting.append(event)
        return is_deferred

    def due(self, now: float, silence: float, stamp_ns: int) -> mailbox.Event | None:
        """Return the report that is due, None if there is none; poll it."""
        if silence > SILENT_AFTER:
            self._connected_since = math.inf
            return None
        self._connected_since = min(self._connected_since, now)
        if not self._waiting or now - self._connected_since < CONNECTED_FOR:
            return None
        level = max(event.level for event in self._waiting)
        text = DELAYED_PREFIX + "; ".join(event.text for event in self._waiting)
        kinds = frozenset({EventKind.DELAYED}).union(*(event.kinds for event in self._waiting))
        self._waiting.clear()
        return mailbox.Event(stamp_ns, level, text, kinds)
