"""Reports an unknown heading: on a single marker only horizontal motion shows it."""

from __future__ import annotations

import math
from collections.abc import Callable

from quadrotor.records import Record
from vehicle import mailbox
from vehicle.modes import Flag

UNKNOWN, KNOWN = math.radians(15.0), math.radians(12.0)
"""rad, deviation above which the heading counts as unknown, and below which as known again: three
of them are 45 degrees, at which position control still works, and not much beyond."""


class HeadingWatch:
    """Monitors the variance of the heading of the estimator in use.

    Args:
        say: takes a line for the log and its level.

    Attributes:
        flags: bits of vehicle.modes.Flag.
    """

    def __init__(self, say: Callable[[str, int], None]) -> None:
        self._say = say
        self.flags, self._deviation = 0, math.nan

    @property
    def state(self) -> str:
        """Return how well the heading is known, with the bound."""
        now, allowed = math.degrees(self._deviation), math.degrees(UNKNOWN)
        return f"known to {now:.0f}°, allowed {allowed:.0f}°"

    def check(self, estimate: Record) -> None:
        """Check the ESTIMATE (1,) that the estimator reported after a measurement; one of fixed
        gains reports no variance.
        """
        self._deviation = math.sqrt(estimate["attitude_variance_w"][0, 2])
        if not self.flags and self._deviation > UNKNOWN:
            self.flags = int(Flag.HEADING_UNKNOWN)
            line = f"heading not observed: {self.state}; fly back and forth, or land"
            self._say(line, mailbox.WARN)
        elif self.flags and not self._deviation > KNOWN:
            self.flags = 0
            self._say("heading known again", mailbox.INFO)
