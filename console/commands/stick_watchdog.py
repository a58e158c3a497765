"""The station's watchdog over the sticks: silence drops them, and a drop latches.

After a drop the dead-man must be seen released before it counts again, so that a button held
through an outage does not move the vehicle by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

CENTRED = (0.0, 0.0, 0.0, 0.0)
REPEATS = 3
"""Number of times that the order to stop is sent, as sticks travel best effort; the vehicle has its
own watchdog."""


@dataclass(frozen=True, slots=True)
class StickOrder:
    """A stick order to the vehicle: axes (forward, left, up, yaw) in -1..1."""

    axes: tuple[float, float, float, float]
    enabled: bool


DROPPED = StickOrder(CENTRED, False)


class StickWatchdog:
    """Drops silent sticks. Times in s of any steady clock."""

    def __init__(self) -> None:
        self._held_at: float | None = None  # s, last message while enabled
        self.dropped = False
        """True from the moment the sticks are dropped until the dead-man button is released."""
        self._repeats = 0

    def feed(
        self, axes: tuple[float, float, float, float], enabled: bool, now: float, timeout: float
    ) -> StickOrder:
        """Handle one message of the page's sticks; return the message to forward to the vehicle."""
        if self._held_at is not None and now - self._held_at > timeout:
            self._drop()
        if not enabled:
            if self._held_at is not None:
                self._repeats = REPEATS - 1
            self._held_at = None
            self.dropped = False
            return DROPPED
        if self.dropped:
            return DROPPED
        self._held_at = now
        self._repeats = 0
        return StickOrder(axes, True)

    def tick(self, now: float, timeout: float) -> StickOrder | None:
        """Return the order to stop while it must be sent, or None; called when it is `due`."""
        if self._held_at is not None and now - self._held_at > timeout:
            self._drop()
        if self._repeats > 0:
            self._repeats -= 1
            return DROPPED
        return None

    def due(self, now: float, timeout: float) -> float | None:
        """Return the seconds until silence becomes a drop; None = nothing to drop."""
        return None if self._held_at is None else max(self._held_at + timeout - now, 0.0) + 1e-4

    def _drop(self) -> None:
        self._held_at = None
        self.dropped = True
        self._repeats = REPEATS
