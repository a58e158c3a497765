"""Publish why the vehicle braked or landed while no station heard it, once one hears it again.

What it says at such a moment reaches its log and its terminal; the link it could be heard by is the
very thing that is gone, and a station that is started again was not there.
"""

from __future__ import annotations

import math
from collections import deque

from vehicle.processes import mailbox
from vehicle_link.topics import DELAYED_PREFIX

MOST = 8
"""Warnings that are told; of more the newest."""
SILENT = 0.3
"""s without a station, from which on what is said may not be heard."""
SETTLED = 3.0
"""s with a station, after which whoever listens to it listens again."""


class Unheard:
    """Used by one thread; times in s of one monotonic clock."""

    def __init__(self) -> None:
        self._kept: deque[tuple[int, str]] = deque(maxlen=MOST)
        self._heard_since = math.inf

    def said(self, event: mailbox.Event, silence: float) -> bool:
        """Return whether it is kept: a warning that may not be heard.

        Args:
            silence: since the station was heard; inf before the first time.
        """
        is_kept = event.level >= mailbox.WARN and SILENT < silence < math.inf
        if is_kept:
            self._kept.append((event.level, event.text))
        return is_kept

    def due(self, now: float, silence: float) -> tuple[int, str] | None:
        """Return level and text of what is to be reported now; to be asked again and again."""
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
