"""The time in flight, and figures over blocks of it, for all detectors.

Times are s since the run's first message.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from console.evaluation.findings import Array, Parameters, Spans, Topics
from flight_log.fields import ATTITUDE, MARKED, POSITION, TRACKED
from flight_log.run import Series

ROLL_PITCH = ATTITUDE[1:3]
BLOCK = 2.0
"""Time in s over which most figures are computed."""
SETTLING = 2.0
"""Seconds after take-off and before landing that are not judged, because of the ground effect."""
SHORTEST = 3.0
"""Shortest flight in s of which something is said."""
AIRBORNE_HEIGHT = 0.5
"""Height in m above the lowest point that counts as flying, for logs without the status."""


def airborne(topics: Topics) -> Spans:
    """Return the intervals of flight (s) without take-off and landing."""
    if has(topics, "status", "airborne"):
        series = topics["status"]
        on = series.values("airborne") > 0.5
    elif has(topics, "state", POSITION[2]):
        series = topics["state"]
        height = series.values(POSITION[2])
        on = height > np.nanmin(height, initial=np.inf) + AIRBORNE_HEIGHT
    else:
        return []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(np.int8)))
    ends = np.append(series.time, series.time[-1:])
    spans = zip(ends[edges[::2]].tolist(), ends[edges[1::2]].tolist(), strict=True)
    return [_settled(a, b) for a, b in spans if b - a > SHORTEST]


def _settled(start: float, end: float) -> tuple[float, float]:
    """Return the part of a flight that is judged: most of one that ends within seconds."""
    left_out = min(SETTLING, (end - start) / 6.0)
    return start + left_out, end - left_out


def has(topics: Topics, topic: str, *names: str) -> bool:
    """Return whether the log has these fields."""
    return topic in topics and all(name in topics[topic] for name in names)


def tracker_of(topics: Topics) -> tuple[str, tuple[str, ...]]:
    """Return the topic of the tracker and its position fields: of poses, or of a marker."""
    of_marker = has(topics, "tracker_position", *MARKED)
    return ("tracker_position", MARKED) if of_marker else ("tracker_pose", TRACKED)


def tilts(topics: Topics) -> tuple[Array, Array]:
    """Return the times (s) of the state, and the tilts (deg) then; empty without attitudes."""
    if not has(topics, "state", *ROLL_PITCH):
        return np.zeros(0), np.zeros(0)
    x, y = topics["state"].rows(ROLL_PITCH).T
    tilt = np.degrees(np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)))
    return topics["state"].time, tilt


def number(parameters: Parameters, name: str, default: float) -> float:
    value = parameters.get(name, default)
    return float(value) if isinstance(value, int | float) else default


def overlaps(spans: Spans, start: float, end: float) -> bool:
    return any(start < b and a < end for a, b in spans)


def distances(
    series: Series, names: Sequence[str], other: Series, other_names: Sequence[str]
) -> Array:
    """Return the distances (m) of a topic's position from that of another at its times; NaN
    outside.
    """
    away = np.zeros(len(series))
    for name, known in zip(names, other_names, strict=True):
        expected = np.interp(series.time, other.time, other.values(known), np.nan, np.nan)
        away += (series.values(name) - expected) ** 2
    found: Array = np.sqrt(away)
    return found


def blocks(
    time: Array,
    values: Array,
    spans: Spans,
    figure: Callable[[Array], Array],
    length: float = BLOCK,
) -> tuple[Array, Array]:
    """Return the starts (M,) of the blocks of flight and their figures (M, K) of values (N, K)."""
    starts, found = [], []
    for start, end in spans:
        for begin in np.arange(start, end - length + 1e-9, length):
            first, last = np.searchsorted(time, (begin, begin + length))
            rows = values[first:last]
            rows = rows[np.isfinite(rows).all(axis=1)]
            if len(rows) > 3:
                starts.append(float(begin))
                found.append(figure(rows))
    if not found:
        return np.zeros(0), np.zeros((0, values.shape[1]))
    return np.array(starts), np.array(found)


def longest(time: Array, values: Array, limit: float, least: int, length: float = BLOCK) -> Spans:
    """Return the heaviest stretch of at least `least` consecutive blocks above a limit; empty
    without one.
    """
    over = np.flatnonzero(values > limit)
    apart = np.flatnonzero((np.diff(over) > 1) | (np.diff(time[over]) > 1.5 * length)) + 1
    stretches = [one for one in np.split(over, apart) if len(one) >= least]
    if not stretches:
        return []
    heaviest = max(stretches, key=lambda one: float(values[one].sum()))
    return [(float(time[heaviest[0]]), float(time[heaviest[-1]]) + length)]


def means(rows: Array) -> Array:
    found: Array = rows.mean(axis=0)
    return found


def medians(rows: Array) -> Array:
    found: Array = np.median(rows, axis=0)
    return found


def rms_of(rows: Array) -> Array:
    found: Array = np.sqrt((rows**2).mean(axis=0))
    return found


def lowest(rows: Array) -> Array:
    found: Array = rows.min(axis=0)
    return found
