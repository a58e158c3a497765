"""The outcomes of a measurement, the same for every filter."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

AHEAD_NS = 20_000_000
"""Time in ns by which a measurement may be ahead of the newest IMU sample: clock error, serial
latency."""
LATEST_NS = 600_000_000
"""Largest delay in ns, where the estimator goes back so far; later measurements are
applied again."""
NORM_TOLERANCE = 0.02
"""Largest deviation of the squared length of a measured quaternion or bearing from 1."""


class Outcome(IntEnum):
    """The outcome of a measurement."""

    APPLIED = 0
    TOO_OLD = 1  # older than the history
    NOT_NEWER = 2  # not newer than the last applied one, or a repetition
    AHEAD = 3  # more than AHEAD_NS ahead of the IMU
    INVALID = 4  # not finite, or not of unit length
    OUTLIER = 5  # beyond the gate


class JudgedReading(NamedTuple):
    """The judgement of a filter on one reading, in the reading's unit.

    Attributes:
        residual: measured less what the filter expected; NaN when it did not compare them.
        gate: least residual that it refuses; NaN likewise.
    """

    outcome: Outcome
    residual: float = math.nan
    gate: float = math.nan


class Agreement(IntEnum):
    """The agreement of the newest measurements with the estimate."""

    USED = 0  # the newest one was used
    REFUSED = 1  # the gate refused it as too far from its prediction
    JUMPED = 2  # refused too, but refused ones agree with each other: the tracker jumped
    DRIFTED = 3  # as far, but it left the prediction little by little: the estimate drifted
    MOVED = 4  # the estimate was moved to the measurements refused before
