"""On the ground or in the air: from take-off to the rest after touch-down."""

from __future__ import annotations

TAKEN_OFF = 0.03
"""m above where it was armed; the noise of a pose stays below."""


class GroundContact:
    """Stamps in ns of the vehicle's clock, heights in m."""

    def __init__(self) -> None:
        self.airborne = False
        self.ground_z = 0.0
        self._landed_ns: int | None = None

    def arm(self, z: float) -> None:
        """The vehicle stands at this height."""
        self.ground_z = z

    def disarm(self) -> None:
        self.airborne = False
        self._landed_ns = None

    def rise(self, z: float) -> None:
        """Until it is in the air: at this height now."""
        self.airborne = z - self.ground_z > TAKEN_OFF

    def touch_down(self, stamp_ns: int) -> bool:
        """It has landed; whether that is news."""
        self.airborne = False
        if self._landed_ns is not None:
            return False
        self._landed_ns = stamp_ns
        return True

    def rested(self, stamp_ns: int) -> float:
        """s since touch-down, -1 before it."""
        return -1.0 if self._landed_ns is None else (stamp_ns - self._landed_ns) * 1e-9
