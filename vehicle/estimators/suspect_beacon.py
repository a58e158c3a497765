"""Reports a beacon whose bearings are off, once when it begins and once when it ends."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable

from vehicle import mailbox
from vehicle.estimators.beacon_offsets import LEAST, Offset
from vehicle.modes import Flag

UNIDENTIFIED = -1
"""Used in place of an id when the beacon cannot be identified."""


class SuspectBeacon:
    """Monitors `BeaconOffsets.suspect`.

    Args:
        say: takes a line for the log and its level.

    Attributes:
        flags: bits of vehicle.modes.Flag.
        status: id (UNIDENTIFIED when not known), mean offset (rad), whether it is left out.
    """

    def __init__(self, say: Callable[[str, int], None]) -> None:
        self._say = say
        self._reported: Offset | None = None
        self.begin()

    def begin(self) -> None:
        """Begin again with another estimator in use; reports about the previous one end."""
        self._reported = None
        self.flags, self.status = 0, (UNIDENTIFIED, 0.0, False)

    def check(self, suspect: Offset | None, left_out: bool, hindrance: str) -> None:
        """Check for a beacon that is off, after a frame of bearings.

        Args:
            left_out: whether the estimator ignores that beacon. hindrance: why it does not,
            although that is enabled; empty otherwise.
        """
        before, self._reported = self._reported, suspect
        if suspect is None:
            if before is not None:
                self._say(f"{_subject(before.beacon)} fit the others again", mailbox.INFO)
                self.begin()
            return
        known = suspect.beacon is not None
        id = int(str(suspect.beacon)) if known else UNIDENTIFIED
        self.flags, self.status = int(Flag.BEACON_OFF), (id, suspect.angle, left_out)
        if before is not None and before.beacon == suspect.beacon:
            return
        degrees = math.degrees(suspect.angle)
        line = f"{_subject(suspect.beacon)} are off by {degrees:.1f}° on average"
        if not known:
            line += f"; it cannot be identified without the tracker or {LEAST + 1} beacons"
        elif left_out:
            line += "; left out"
        elif hindrance:
            line += f"; not left out: {hindrance}"
        self._say(line, mailbox.WARN)


def _subject(beacon: Hashable | None) -> str:
    return "bearings of one beacon" if beacon is None else f"bearings of beacon {beacon}"
