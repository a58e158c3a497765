"""Height and climb rate from barometer and accelerometer, independent of the estimator."""

from __future__ import annotations

from quadrotor.vehicle_model import GRAVITY

PASCALS_PER_METRE = 11.6
"""Pressure gradient of the standard atmosphere in the lowest few hundred metres."""
FARTHEST = 2.0
"""m, ten standard deviations: larger errors are clipped to this, because a damaged frame whose
checksum fits by chance can contain any value."""
POLE = 1.2
"""rad/s, triple pole: the barometer's noise of 0.2 m gives a climb rate good to 0.02 m/s."""
LONGEST_HELD = 0.05
"""s, the longest step of one reading: after a gap the correction would overshoot otherwise."""


class BarometricHeight:
    """An observer of height, climb rate and accelerometer bias.

    The vehicle is assumed to be nearly level: a tilt of 20 degrees looks like 0.6 m/s² downwards
    while it lasts.

    Attributes:
        height: m above the place where `set_ground` was called last. climb: m/s.
        is_believed: whether the barometer is used; otherwise the accelerometer alone.
    """

    def __init__(self) -> None:
        self.height = self.climb = self._bias = 0.0
        self.is_believed = True
        self._ground: float | None = None  # Pa

    def set_ground(self, pressure: float, dt: float) -> None:
        """Set the zero of the height, on the ground with motors off."""
        if self._ground is None:
            self._ground = pressure
        self._ground += min(1.0, dt) * (pressure - self._ground)
        self.height = self.climb = self._bias = 0.0
        self.is_believed = True

    def disbelieve(self, height: float, climb: float, bias: float) -> None:
        """Go on by the accelerometer alone until the next `set_ground`.

        Args:
            height, climb: at present, m and m/s.
            bias: of the accelerometer along z_B, m/s².
        """
        self.height, self.climb, self._bias = height, climb, bias
        self.is_believed = False

    def step(self, pressure: float, lift: float, dt: float) -> None:
        """Update with one sample: pressure (Pa) and specific force along z_B (m/s²), dt (s) after
        the last.
        """
        if self._ground is None:
            self._ground = pressure
        up = lift - GRAVITY - self._bias
        height = self.height + (self.climb + 0.5 * up * dt) * dt
        climb = self.climb + up * dt
        error = (self._ground - pressure) / PASCALS_PER_METRE - height
        error = min(FARTHEST, max(-FARTHEST, error))
        w, held = POLE, min(dt, LONGEST_HELD)
        if not self.is_believed:
            self.height, self.climb = height, climb
            return
        self.height = height + 3.0 * w * held * error
        self.climb = climb + 3.0 * w * w * held * error
        self._bias -= w * w * w * held * error
