"""What may become of a measurement, the same for every filter."""

from __future__ import annotations

from enum import IntEnum

AHEAD_NS = 20_000_000
"""A measurement may be this far ahead of the newest IMU sample: clock error, serial latency."""
NORM_TOLERANCE = 0.02
"""How far the squared length of a measured quaternion or bearing may be from 1."""


class Outcome(IntEnum):
    """What became of a measurement."""

    APPLIED = 0
    TOO_OLD = 1  # older than the history
    NOT_NEWER = 2  # not newer than the last one applied, or a repetition
    AHEAD = 3  # more than AHEAD_NS ahead of the IMU
    INVALID = 4  # not finite, or not of unit length
    OUTLIER = 5  # beyond the gate


class Agreement(IntEnum):
    """Of the newest measurements with the estimate."""

    USED = 0  # the newest one was used
    REFUSED = 1  # the newest one was refused by the gate
    # Measurements are refused that agree with each other and with the motion, so either
    JUMPED = 2  # the tracker is wrong by now: they moved away from the estimate at once
    DRIFTED = 3  # or the estimate is: it moved away from them little by little
