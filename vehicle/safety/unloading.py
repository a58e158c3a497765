"""Test of a presumed touch-down: thrust is taken away, and what the accelerometer then shows tells
the ground from the air.

On the ground the specific force stays that of rest, however little the motors give, because the
ground carries the difference. In the air it falls with the thrust, whatever gust, updraught or
released load first looked like the ground.
"""

from __future__ import annotations

import math
from enum import Enum, auto

from quadrotor.vehicle_model import GRAVITY

RAMP = 4.0
"""Shares of the weight by which the thrust falls in a second."""
MOST = 0.7
"""Largest share of the weight that is taken off the thrust."""
LAG = 0.06
"""Time constant, in s, with which the thrust in the air follows its command, at most."""
SMOOTHING = 0.02
"""Time constant, in s, of the mean specific force."""
LIFTED, DROPPED, CARRIED = 0.45, 0.5, 0.85
"""On the ground the thrust gives less than the first share of g, or what it gives has fallen by
more than the second, while the specific force is more than the third. What a thrust gives is
learnt, and may be wrong; a fall of the thrust that nothing follows shows the ground all the same.
"""
DWELL = 0.03
"""Time, in s, for which the one or the other must show."""
STUCK_SAMPLES = 60
"""Number of equal readings after which the accelerometer is stuck; calm axes in whole counts stay
the same for up to 26 samples at 500 Hz."""
SHAKEN, SHAKEN_TIME, SANK = 2.0, 0.5, 0.3
"""Vibration before a test, m/s², its time constant, s, and the speed in m/s lost in the test by the
accelerometer, beyond all of which it is in the air: vibration hides a fall for some hundredths."""
SHAKEN_DWELL = 0.1
"""Time, in s, over which the mean specific force of a vehicle that shakes must be that of rest."""
LONGEST = 0.4
"""Time, in s, after which a test ends: on the ground where the specific force is that of rest, as
no air carries a vehicle that has given up so much thrust; else in the air."""


class Verdict(Enum):
    """The outcome of a test so far."""

    OPEN = auto()
    GROUND = auto()
    AIR = auto()


class Unloading:
    """The test, which may be repeated.

    Attributes:
        share: share of the weight that is taken off the commanded thrust now; 0 without a test.
    """

    def __init__(self) -> None:
        self.share = 0.0
        self._lift = self._thrust_lift = self._began_at = GRAVITY
        self._lasted = self._carried = self._falling = self._sunk = self._sunk_before = 0.0
        self._reading, self._repeats, self._shake = math.nan, 0, 0.0

    @property
    def is_blind(self) -> bool:
        """Return whether the accelerometer repeats one reading, so that a test shows nothing."""
        return self._repeats >= STUCK_SAMPLES

    @property
    def is_running(self) -> bool:
        """Return whether thrust is being taken away."""
        return self.share > 0.0

    @property
    def lift(self) -> float:
        """Return the mean specific force along z_B, m/s²."""
        return self._lift

    @property
    def unexplained(self) -> float:
        """Return the specific force along z_B, m/s², that the commanded thrust does not give."""
        return self._lift - self._thrust_lift

    def end(self) -> None:
        """Give all thrust back."""
        self.share = self._lasted = self._carried = self._falling = self._sunk = 0.0

    def observe(self, lift: float, thrust_lift: float, dt: float) -> None:
        """Follow one sample, in a test and before it; one that is not finite is left out.

        Args:
            lift: m/s², specific force along z_B.
            thrust_lift: m/s², the part of it that the commanded thrust gives in the air.
        """
        if not math.isfinite(lift + thrust_lift):
            return
        self._repeats = self._repeats + 1 if lift == self._reading else 0
        self._reading = lift
        if self.is_running:
            self._sunk += dt * (GRAVITY - lift)
        else:
            self._shake += min(1.0, dt / SHAKEN_TIME) * (abs(lift - self._lift) - self._shake)
        self._lift += min(1.0, dt / SMOOTHING) * (lift - self._lift)
        self._thrust_lift += min(1.0, dt / LAG) * (thrust_lift - self._thrust_lift)

    def step(self, dt: float) -> Verdict:
        """Reduce the thrust further, and judge the samples so far."""
        if not self.is_running:
            self._began_at = self._thrust_lift
        self.share = min(MOST, self.share + RAMP * dt)
        self._lasted += dt
        # Half-way between a thrust that carries all and a ground that carries the rest.
        falls = self._lift < 0.5 * (GRAVITY + min(GRAVITY, self._thrust_lift)) - 0.05 * GRAVITY
        dropped = self._began_at - self._thrust_lift > DROPPED * GRAVITY
        gives_little = dropped or self._thrust_lift < LIFTED * GRAVITY
        shakes, dwell = self._shake > SHAKEN, DWELL
        sinks = shakes and self._sunk > SANK
        rests = self._lift > CARRIED * GRAVITY
        if shakes:
            dwell, since = SHAKEN_DWELL, self._sunk - self._sunk_before
            rests = since < (1.0 - CARRIED) * GRAVITY * self._carried
            self._carried = self._carried + dt if gives_little else 0.0
        else:
            self._carried = self._carried + dt if gives_little and rests else 0.0
        if self._carried <= dt:
            self._sunk_before = self._sunk
        is_over = self._lasted > LONGEST
        self._falling = self._falling + dt if falls else 0.0
        if rests and not sinks and (self._carried >= dwell or is_over):
            return Verdict.GROUND
        if self._falling >= DWELL or sinks or is_over:
            return Verdict.AIR
        return Verdict.OPEN
