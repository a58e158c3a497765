"""The rule by which a person's sticks take over from an experiment: deflected on purpose."""

from __future__ import annotations

from enum import Enum

from console.commands.stick_watchdog import StickOrder
from vehicle_link.clock import monotonic

DEFLECTED = 0.15
"""Share of full deflection above which, with the dead-man held, a person takes over."""
SILENT = 0.3
"""s without sticks, after which they count as released."""


class _Until(Enum):
    """The state the sticks must pass through before they can take over."""

    NOTHING = 0
    CENTRED = 1  # they were deflected when the experiment began
    RELEASED = 2  # the dead-man must be released: a person was flying by hand


class StickTakeover:
    """A watch for a person who deflects the sticks."""

    def __init__(self) -> None:
        self._deflected, self._seen = False, -SILENT
        self._blind_until = _Until.NOTHING

    def begin(self) -> None:
        """Begin an experiment: sticks that are deflected now do not count."""
        old = monotonic() - self._seen > SILENT
        is_deflected = self._deflected and not old
        self._blind_until = _Until.CENTRED if is_deflected else _Until.NOTHING

    def by_hand(self) -> None:
        """Let a person fly: sticks still deflected at the end do not take over."""
        self._blind_until = _Until.RELEASED

    def seen(self, order: StickOrder) -> bool:
        """Process one stick command; return whether it takes over."""
        now = monotonic()
        deflected = order.enabled and max(map(abs, order.axes)) > DEFLECTED
        centred = self._blind_until is _Until.CENTRED and not deflected
        if centred or not order.enabled or now - self._seen > SILENT:
            self._blind_until = _Until.NOTHING
        self._deflected, self._seen = deflected, now
        return deflected and self._blind_until is _Until.NOTHING
