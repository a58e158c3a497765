"""Findings about poses that scatter from one to the next more than a tracker's do."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from console.evaluation.findings import Array, Finding, Parameters, Spans, Topics
from extensions.explanation.blocks import blocks, has, longest
from flight_log.fields import TRACKED, TRACKED_ATTITUDE
from quadrotor.plain_rotations import make_continuous

METRES, DEGREES = 0.005, 0.6
"""Limits of the standard deviation on one axis."""
SHORT = 0.5
"""Time in s over which it is taken."""
LONGEST = 0.03
"""Longest time in s between poses; beyond it the vehicle's own motion between them shows."""


def tracker_noisy(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find poses that are not on a smooth line with those before and after them."""
    if not has(topics, "tracker_pose", *TRACKED, *TRACKED_ATTITUDE):
        return
    series = topics["tracker_pose"]
    fresh = np.concatenate([[True], np.diff(series.time) > 0.0])
    time = series.time[fresh]
    if len(time) < 3:
        return
    attitudes = series.rows(TRACKED_ATTITUDE)[fresh].astype(np.float64)
    make_continuous(attitudes)
    turned = np.degrees(2.0 * attitudes[:, 1:])
    rows = np.hstack([series.rows(TRACKED)[fresh].astype(np.float64), turned])
    off = rows[1:-1] - 0.5 * (rows[:-2] + rows[2:])
    before, after = time[1:-1] - time[:-2], time[2:] - time[1:-1]
    even = (before < 1.5 * after) & (after < 1.5 * before) & (after < LONGEST)
    starts, scatter = blocks(time[1:-1][even], np.abs(off[even]), spans, _deviation, SHORT)
    limits = np.array([METRES] * 3 + [DEGREES] * 3)
    over = (scatter / limits).max(axis=1, initial=0.0)
    for start, end in longest(starts, over, 1.0, 1, SHORT):
        inside = (starts >= start) & (starts < end)
        most = np.median(scatter[inside], axis=0)
        yield Finding(
            "tracker_noisy",
            float(np.median(over[inside])),
            start=start,
            end=end,
            claim=f"The tracker's poses scattered by {1e3 * most[:3].max():.1f} mm and "
            f"{most[3:].max():.2f}° from one to the next (limits {1e3 * METRES:g} mm and "
            f"{DEGREES:g}°).",
            alike=("markers that are hidden or too near to each other", "a camera that moves"),
            signals=tuple(f"tracker_pose/{name}" for name in TRACKED),
            label="standard deviation of the poses over its limit",
            unit="",
            limit=1.0,
            time=starts + SHORT / 2,
            values=over,
        )


def _deviation(rows: Array) -> Array:
    """Return the standard deviation of one pose, by the median of its distances from its
    neighbours' mean, whose variance is half as large.
    """
    found: Array = 1.4826 * np.median(rows, axis=0) / np.sqrt(1.5)
    return found
