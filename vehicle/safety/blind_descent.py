"""A watch over descents by the barometer: none lasts for ever, and none ends hard.

A room's pressure changes when a door opens, and a damaged sensor drifts. So the barometer is
compared with the accelerometer, whose climb rate and bias are known from the poses until they end.
Where they disagree the vehicle descends by the accelerometer. A descent that is longer or deeper
than it can be becomes faster until there is ground.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from quadrotor.vehicle_model import GRAVITY
from vehicle.safety.barometric_height import LONGEST_HELD, BarometricHeight

POLE_POSES, POLE_ALONE = 1.0, 0.1
"""Poles, in rad/s, with which the accelerometer's climb rate follows that of the estimator, and,
long after the last pose, that of the barometer."""
REMEMBERED = 5.0
"""Time, in s, for which the accelerometer alone continues the climb rate known by poses."""
LARGEST_BIAS = 0.3
"""m/s², of the accelerometer after its calibration."""
DOUBT, DOUBT_ALONE, DOUBT_GROWTH, DOUBT_LASTS = 0.25, 0.6, 0.02, 0.2
"""Differences of both climb rates, in m/s, that are doubted: with poses before the descent, and
without; their growth in a descent, in m/s², which is that of the accelerometer; and the time, in s,
for which one must last."""
DEEPEST = 1.5
"""Height, in m below the place of take-off, at which the ground should have been found."""
SHOCK = 1.9
"""Specific force, in weights, that only a hard touch-down gives: an accelerometer of ± 2 weights
does not measure it, and no longer knows the climb rate."""
SETTLING = 2.0
"""Time, in s, that the barometer's climb rate needs after that."""
SPARE = 8.0
"""Time, in s, by which a descent may exceed what its height needs at half its speed."""
FASTER = 0.1
"""Growth, in m/s², of the speed of a descent that should have ended."""


class BlindDescent:
    """Watch over descents by the barometer.

    Args:
        altitude: by the barometer; it is told when the barometer is not believed.
        say: takes a line for the log.

    Attributes:
        extra: m/s, by which the descent is faster than commanded.
    """

    def __init__(self, altitude: BarometricHeight, say: Callable[[str], object]) -> None:
        self._altitude, self._say = altitude, say
        self.extra = 0.0
        self._height = self._climb = self._bias = 0.0
        self._doubted_s = self._shaken_s = self._lasted_s = self._longest_s = 0.0
        self._alone_s = math.inf
        self._is_over_due = False
        self._has_begun = False  # knows the climb rate of this flight

    def rest(self) -> None:
        """Begin anew, on the ground. The bias stays what it was."""
        self._height, self._climb, self._alone_s = 0.0, 0.0, math.inf
        self._has_begun = False

    def follow(self, vertical_force: float, motion: tuple[float, float] | None, dt: float) -> None:
        """Learn the accelerometer's bias in a flight that is no blind descent.

        Args:
            vertical_force: specific force along z_W, m/s².
            motion: height above the ground (m) and climb rate (m/s) by poses; None without poses.
            dt: s since the last sample.
        """
        self._lasted_s = self._doubted_s = self.extra = 0.0
        self._is_over_due = False
        pole, held = POLE_POSES, min(dt, LONGEST_HELD)
        self._alone_s = 0.0 if motion is not None else self._alone_s + dt
        if motion is None:
            pole = POLE_ALONE if self._alone_s > REMEMBERED else 0.0
        height, climb = motion or (self._altitude.height, self._altitude.climb)
        if motion is not None and not self._has_begun:
            # It climbs already when it is found to be in the air: that is no bias.
            self._height, self._climb, self._has_begun = height, climb, True
        error = climb - self._climb
        self._height += self._climb * dt + pole * (height - self._height) * held
        self._climb += (vertical_force - GRAVITY - self._bias) * dt + 2.0 * pole * error * held
        bias = self._bias - pole * pole * error * held
        self._bias = min(LARGEST_BIAS, max(-LARGEST_BIAS, bias))

    def distrust_accelerometer(self) -> None:
        """Believe the barometer for some time, as poses contradict the accelerometer, and it may be
        the accelerometer that is wrong.
        """
        self._shaken_s = SETTLING

    def watch(self, lift: float, speed: float, dt: float) -> None:
        """Judge a descent after a sample: `lift`, the specific force along z_B (m/s²), the
        commanded `speed` (m/s), and dt (s).
        """
        altitude = self._altitude
        if not self._lasted_s:
            self._longest_s = SPARE + 2.0 * max(0.0, altitude.height) / speed
        self._lasted_s += dt
        self._shaken_s = SETTLING if lift > SHOCK * GRAVITY else self._shaken_s - dt
        if self._shaken_s > 0.0:
            self._climb, self._alone_s = altitude.climb, math.inf
        self._height += self._climb * dt
        self._climb += (lift - GRAVITY - self._bias) * dt
        off = altitude.climb - self._climb
        limit = DOUBT if self._alone_s <= REMEMBERED else DOUBT_ALONE
        is_doubtful = abs(off) > limit + DOUBT_GROWTH * self._lasted_s
        self._doubted_s = self._doubted_s + dt if is_doubtful else 0.0
        if is_doubtful:
            if altitude.is_believed and self._doubted_s > DOUBT_LASTS:
                altitude.disbelieve(self._height, self._climb, self._bias)
                why = f"barometer and accelerometer disagree by {abs(off):.1f} m/s"
                self._say(f"{why}: descending by the accelerometer")
        elif altitude.height < -DEEPEST or self._lasted_s > self._longest_s:
            self.extra += FASTER * dt
            if not self._is_over_due:
                self._is_over_due = True
                self._say("no ground where it should be: sinking faster and faster")
