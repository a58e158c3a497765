"""Tells people of a beacon whose bearings are off, once at its beginning and once at its end."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable

from vehicle.estimators.beacon_offsets import LEAST, Offset
from vehicle.flight.modes import Flag
from vehicle.processes import mailbox

UNTOLD = -1
"""In place of an id where it cannot be told which beacon it is."""


class SuspectBeacon:
    """Follows `BeaconOffsets.suspect`.

    Args:
        say: takes a line for the log and its level.

    Attributes:
        flags: bits of vehicle.flight.modes.Flag.
        status: id (UNTOLD when not known which), mean offset (rad), whether it is left out.
    """

    def __init__(self, say: Callable[[str, int], None]) -> None:
        self._say = say
        self._said: Offset | None = None
        self.begin()

    def begin(self) -> None:
        """Begin with another estimator in use; what was reported of the last one is over."""
        self._said = None
        self.flags, self.status = 0, (UNTOLD, 0.0, False)

    def look(self, suspect: Offset | None, left_out: bool, hindrance: str) -> None:
        """Look for a beacon that is off, after a frame of bearings.

        Args:
            left_out: whether the estimator goes without that beacon. hindrance: why it does not
                although it is wanted; empty otherwise.
        """
        said, self._said = self._said, suspect
        if suspect is None:
            if said is not None:
                self._say(f"{_subject(said.beacon)} fit the others again", mailbox.INFO)
                self.begin()
            return
        known = suspect.beacon is not None
        id = int(str(suspect.beacon)) if known else UNTOLD
        self.flags, self.status = int(Flag.BEACON_OFF), (id, suspect.angle, left_out)
        if said is not None and said.beacon == suspect.beacon:
            return
        degrees = math.degrees(suspect.angle)
        line = f"{_subject(suspect.beacon)} are off by {degrees:.1f} deg on average"
        if not known:
            line += f"; which one cannot be told: it takes the tracker, or {LEAST + 1} beacons"
        elif left_out:
            line += "; left out"
        elif hindrance:
            line += f"; not left out: {hindrance}"
        self._say(line, mailbox.WARN)


def _subject(beacon: Hashable | None) -> str:
    return "bearings of one beacon" if beacon is None else f"bearings of beacon {beacon}"
