"""The four command bytes in near-hovering mode: pitch, roll, yaw rate and thrust, saturated.

Angles and rate are about the body axes of docs/conventions.md (right-handed, x forward, y left,
z up). Thrust is a fraction of the weight, so that 1 hovers whatever the mass.
"""

from __future__ import annotations

import math

import msgspec

from quadrotor.errors import OutOfBoundsError

ANGLE_COUNTS = 4 / math.radians(1.0)
"""Counts per rad of pitch and roll."""
YAW_RATE_COUNTS = 1 / math.radians(1.0)
"""Counts per rad/s."""
HOVER_THRUST = 110
"""Counts per m g of thrust: the stick position that hovers."""
SIGNED_MAX = 127
THRUST_MIN, THRUST_MAX = 28, 210  # counts

ANGLE_MAX = SIGNED_MAX / ANGLE_COUNTS
"""rad: 31.75 deg."""
YAW_RATE_MAX = SIGNED_MAX / YAW_RATE_COUNTS
"""rad/s: 127 deg/s."""
THRUST_SHARE_MIN, THRUST_SHARE_MAX = THRUST_MIN / HOVER_THRUST, THRUST_MAX / HOVER_THRUST


class AttitudeCommand(msgspec.Struct, frozen=True):
    """The command of near-hovering mode."""

    roll: float  # rad, about x
    pitch: float  # rad, about y
    yaw_rate: float  # rad/s, about z
    thrust_share: float  # T / (m g)
    thrust: float = 0.0  # N, the same thrust
    throttle: float = 0.0  # the fraction of full motor reference that gives it

    def encode(self) -> tuple[int, int, int, int]:
        """Return the command bytes as 0…255, each saturated at its limits.

        Raises OutOfBoundsError when a number is not finite.
        """
        if not math.isfinite(self.roll + self.pitch + self.yaw_rate + self.thrust_share):
            raise OutOfBoundsError(f"{self} cannot be sent; every number must be finite")
        return (
            _signed(self.pitch * ANGLE_COUNTS) & 0xFF,
            _signed(self.roll * ANGLE_COUNTS) & 0xFF,
            _signed(self.yaw_rate * YAW_RATE_COUNTS) & 0xFF,
            min(max(round(self.thrust_share * HOVER_THRUST), THRUST_MIN), THRUST_MAX),
        )


def _signed(counts: float) -> int:
    return min(max(round(counts), -SIGNED_MAX), SIGNED_MAX)
