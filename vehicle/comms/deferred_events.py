"""Publish warnings from while no station was connected, once one is connected again.

Warnings at such a moment reach the vehicle's log and terminal, but not a station: the link is lost,
or the station was not running.
"""

from __future__ import annotations

import math
from collections import deque

from vehicle.processes import mailbox
from vehicle_link.topics import DELAYED_PREFIX

MOST = 8
"""Largest number of warnings that are published; the newest are kept."""
SILENT = 0.3
"""Seconds without a station after which events may not be received."""
SETTLED = 3.0
"""Seconds with a station after which its clients have reconnected."""


class Unheard:
    """Queue of warnings that no station received. Used by one thread; times in s, monotonic."""

    def __init__(self) -> None:
        self._kept: deque[tuple[int, str]] = deque(maxlen=MOST)
        self._heard_since = math.inf

    def said(self, event: mailbox.Event, silence: float) -> bool:
        """Store the event if it is a warning that may not be received; return whether it is stored.

        Args:
            silence: s since the last message of the station; inf before the first.
        """
        is_kept = event.level >= mailbox.WARN and SILENT < silence < math.inf
        if is_kept:
            self._kept.append((event.level, event.text))
        return is_kept

    def due(self, now: float, silence: float) -> tuple[int, str] | None:
        """Return level and text of the report that is due, None if there is none; poll it."""
        if silence > SILENT:
            self._heard_since = math.inf
            return None
        self._heard_since = min(self._heard_since, now)
        if not self._kept or now - self._heard_since < SETTLED:
            return None
        level = max(level for level, _ in self._kept)
        text = DELAYED_PREFIX + "; ".join(text for _, text in self._kept)
        self._kept.clear()
        return level, text
