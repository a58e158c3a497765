"""Figures of safety that belong to the verdict on any flight: hard touch-downs, tilt, emergencies.

An experiment judges what it is about. A flight that ends hard or in an emergency has failed
whatever it measured.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from console.evaluation.findings import AT_BOUND, Spans, flagged, stretches, within
from console.evaluation.frozen_poses import frozen_spans
from console.evaluation.result import FAILED, Result
from flight_log.columns.log_columns import read_columns
from flight_log.fields import ATTITUDE, POSITION, VELOCITY_B
from flight_log.run import Series, read_run
from quadrotor.records import Array

IMPACT, TILT, EMERGENCIES = "impact_m_s", "tilt_max_deg", "emergencies"
FROZEN = "tracker_frozen_s"
"""Time, in s, for which the tracker repeated its poses, or a part of them, in the air."""
FLAGS = {
    "tracker_contradicted": "tracker_contradicted_s",
    "tracker_tilted": "tracker_tilted_s",
    "inertial_suspect": "inertial_suspect_s",
    AT_BOUND: "at_bound_s",
}
"""Flags of the vehicle, and the figures of the time, in s, for which each was set, if it was: poses
contradicted the inertial sensors, the IMU contradicted other witnesses, or a bias, an integral or
an estimate was at its bound."""
LIMITS: Mapping[str, float] = {
    IMPACT: 1.0,
    TILT: 75.0,
    EMERGENCIES: 0.0,
    FROZEN: 0.0,
    "tracker_contradicted_s": 0.0,
    "tracker_tilted_s": 0.0,
    "inertial_suspect_s": 0.0,
}
"""Speed, in m/s, at which a touch-down may damage the vehicle; tilt that no manoeuvre needs, 5°
more than the supervisor allows for 0.2 s; number of emergency landings and cuts."""
HIGH, LOW = 0.10, 0.03
"""Heights, in m above the lowest, of a vehicle in the air and of one that touches the ground."""
SEVERE = ("emergency_land", "cut")
"""Modes of the vehicle that end a flight otherwise than planned."""
AFTER = 3.0
"""Time, in s, after a flight in which the vehicle may still fall, its motors off."""
BEFORE = 0.05
"""Time, in s, before the first touch, in which its speed is looked for."""
_MOTION = (*POSITION, *ATTITUDE, *VELOCITY_B)


def flight_checks(log: Path) -> dict[str, float]:
    """Return the figures of the flight in a log by name; none if the vehicle never flew: movements
    by hand are not judged.

    The motion is the truth, or the vehicle's estimate where there is none. Raises LogFormatError or
    StorageError.
    """
    if not read_columns(log).topics:
        return {}
    topics = read_run(log).topics
    if "status" not in topics or not (flown := _flown(topics["status"])):
        return {}
    modes = [mode for _, mode in topics["status"].changes("mode")]
    figures = {EMERGENCIES: float(sum(mode in SEVERE for mode in modes))}
    motion = topics.get("truth") or topics.get("state")
    if motion is not None:
        figures |= _of_motion(motion, flown)
    poses = topics.get("tracker_pose")
    if poses is not None and (frozen := overlap(frozen_spans(poses), flown)):
        figures[FROZEN] = sum(end - start for start, end in frozen)
    for flag, figure in FLAGS.items():
        if held := overlap(flagged(topics, flag), flown):
            figures[figure] = sum(end - start for start, end in held)
    return figures


def with_checks(result: Result, figures: Mapping[str, float]) -> Result:
    """Return the result of an experiment with these figures of its flight, which can fail it."""
    if not figures:
        return result
    limits = {name: LIMITS[name] for name in figures if name in LIMITS}
    # The experiment's own figures come first, and count where both have one.
    all_figures = result.metrics | dict(figures) | result.metrics
    all_limits = result.limits | limits | result.limits
    failed = any(not all_figures[name] <= all_limits[name] for name in limits)
    verdict, reason = (FAILED, "") if failed else (result.verdict, result.reason)
    return Result(verdict, all_figures, all_limits, reason)


def _flown(status: Series) -> Spans:
    """Return when the vehicle was in the air, and some seconds after, in which it may fall."""
    airborne = stretches(status.time, status.values("airborne") > 0.5)
    return [(start, end + AFTER) for start, end in airborne]


def overlap(spans: Spans, others: Spans) -> Spans:
    """Return the parts (s) of some intervals that lie in others."""
    found = [(max(a, c), min(b, d)) for a, b in spans for c, d in others]
    return [(start, end) for start, end in found if end > start]


def _of_motion(motion: Series, flown: Spans) -> dict[str, float]:
    rows = motion.rows(_MOTION)
    known = within(motion.time, flown) & np.isfinite(rows).all(axis=1)
    time, rows = motion.time[known], rows[known].astype(np.float64)
    if not len(rows):
        return {}
    w, x, y, z = rows[:, 3:7].T
    up = np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    climb = np.einsum("ij,ij->i", up, rows[:, 7:10])
    tilt = math.degrees(float(np.arccos(np.clip(up[:, 2].min(), -1.0, 1.0))))
    hardest = 0.0
    for touched in _touches(rows[:, 2] - rows[:, 2].min()):
        before = np.searchsorted(time, time[touched] - BEFORE)
        hardest = max(hardest, -float(climb[before : touched + 1].min()))
    return {IMPACT: hardest, TILT: tilt}


def _touches(height: Array) -> list[int]:
    """Return the indices at which the vehicle comes from the air to the ground."""
    touches, is_high = [], False
    for index in np.flatnonzero((height > HIGH) | (height < LOW)).tolist():
        if height[index] > HIGH:
            is_high = True
        elif is_high:
            touches.append(index)
            is_high = False
    return touches
