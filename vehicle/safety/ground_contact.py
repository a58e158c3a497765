"""Detection of take-off, touch-down and the rest after it."""

from __future__ import annotations

import math

TAKEN_OFF = 0.03
"""Height, in m above the place of arming, that is a take-off; larger than a pose's noise."""
LEARN = 3.0
"""Time constant, in s, of the average lift per newton, which begins with a plain mean."""
LEAST = 1.0
"""Flight time, in s, after which that average is used for comparison."""


class GroundContact:
    """Detector of ground contact; stamps in ns of the vehicle's clock.

    Ground contact shows in the accelerometer, independently of the estimate: the ground carries
    what the commanded thrust does not. The lift per newton of commanded thrust is learnt in flight,
    so that a wrong mass, a full battery or worn propellers are not mistaken for the ground.
    """

    def __init__(self) -> None:
        self.airborne = False
        self.ground_z = 0.0
        self.carried = 0.0
        """Time, in s, for which the ground has carried its share of the weight."""
        self._landed_ns: int | None = None
        self._flown = self._lift = self._thrust = 0.0
        self._lift_per_newton = 0.0

    @property
    def lift_per_newton(self) -> float:
        """Return the average lift per newton of commanded thrust in the air, 1/kg; 0 before the
        first second of flight.
        """
        return self._lift_per_newton if self._flown > LEAST else 0.0

    def arm(self, z: float) -> None:
        """Set the height of the ground to this height (m) of the vehicle."""
        self.ground_z = z
        self.carried = self._flown = self._lift_per_newton = 0.0
        self._lift = self._thrust = 0.0

    def disarm(self) -> None:
        self.airborne = False
        self._landed_ns = None

    def rise(self, z: float) -> None:
        """Update whether the vehicle is in the air, from its present height (m)."""
        self.airborne = z - self.ground_z > TAKEN_OFF

    def observe(self, lift: float, thrust: float, share: float, dt: float) -> None:
        """Update with one sample in the air.

        Args:
            lift: m/s², specific force along z_B.
            thrust: N, commanded.
            share: share of the lift in the air; an excess by more than this is ground contact.
        """
        if not (thrust > 0.0 and math.isfinite(lift)):
            return
        ratio, learnt = lift / thrust, self._lift_per_newton
        if self._flown > LEAST and ratio > (1.0 + share) * learnt:
            self.carried += dt
            self._lift += lift * dt
            self._thrust += thrust * dt
            return  # no learning on the ground
        self.carried = self._lift = self._thrust = 0.0
        self._flown += dt
        self._lift_per_newton = learnt + (ratio - learnt) * dt / min(LEARN, self._flown)

    def refute(self) -> None:
        """Learn that the presumed ground was air, which carries more than before."""
        if self._thrust > 0.0:
            self._lift_per_newton = self._lift / self._thrust
        self._flown = min(self._flown, LEAST + LEAST)
        self.carried = self._lift = self._thrust = 0.0

    def touch_down(self, stamp_ns: int) -> bool:
        """Note that the vehicle has landed; return whether that is new."""
        self.airborne = False
        if self._landed_ns is not None:
            return False
        self._landed_ns = stamp_ns
        return True

    def rested(self, stamp_ns: int) -> float:
        """Return the seconds since touch-down, -1 before it."""
        return -1.0 if self._landed_ns is None else (stamp_ns - self._landed_ns) * 1e-9
