"""The rules for when a run begins and ends: from arming to a while after disarming, or by hand."""

from __future__ import annotations

from enum import Enum


class Decision(Enum):
    """The recorder's next action."""

    NOTHING = 0
    START = 1
    STOP = 2


class RecordingPolicy:
    """Decides from the vehicle's status and the clock; times in s of any steady clock.

    A run stopped by hand in flight is not begun again until the next arming; arming again before
    the run has ended continues it. A vehicle that starts anew in flight counts as armed until it is
    ready: its motors turn until the microcontroller has landed.
    """

    def __init__(self) -> None:
        self.armed = False
        self._disarmed_at: float | None = None

    @property
    def continues(self) -> bool:
        """Return whether a run is to continue, while armed or for a while afterwards."""
        return self.armed or self._disarmed_at is not None

    def status(self, armed: bool, starting: bool, now: float) -> Decision:
        """Decide for each status message. The first armed one starts a run at once."""
        was_armed = self.armed
        self.armed = armed or (was_armed and starting)
        if self.armed:
            self._disarmed_at = None
            return Decision.NOTHING if was_armed else Decision.START
        if was_armed:
            self._disarmed_at = now
        return Decision.NOTHING

    def tick(self, now: float, after_disarm: float) -> Decision:
        """Decide several times a second whether a run ends; `after_disarm` in s."""
        if self._disarmed_at is not None and now - self._disarmed_at >= after_disarm:
            self._disarmed_at = None
            return Decision.STOP
        return Decision.NOTHING
