"""Ticks of a level vehicle at rest, for tests of logs."""

from __future__ import annotations

import numpy as np

from quadrotor.records import TICK, Record

START_NS = 1_780_000_000_000_000_000
STEP_NS = 2_000_000


def level_ticks(first: int, count: int, *, armed: bool = True) -> Record:
    """Return ticks numbered from `first`, 2 ms apart."""
    made = np.zeros(count, TICK)
    numbers = np.arange(first, first + count)
    made["sequence"] = numbers
    made["imu"]["stamp_ns"] = START_NS + STEP_NS * numbers
    made["state"]["quaternion_wb"][:, 0] = 1.0
    made["status"]["armed"] = armed
    return made
