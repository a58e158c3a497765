"""Findings that can cause others: a weak motor, vibration, the tracker, the link, the battery."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from console.evaluation.findings import Array, Finding, Parameters, Spans, Topics, flagged, within
from extensions.explanation.blocks import (
    BLOCK,
    SETTLING,
    blocks,
    distances,
    has,
    longest,
    lowest,
    means,
    number,
    overlaps,
    rms_of,
    tracker_of,
)
from flight_log.fields import FORCE, POSITION, THRUSTS, axes
from quadrotor.constants import MOTORS

WEAK_MOTOR = 0.06
"""Limit of the thrust commanded of one motor relative to the others, minus 1."""
VIBRATION, VIBRATION_FROM = 2.5, 15.0
"""Limit in m/s² rms on one axis of the accelerometer, above this frequency in Hz."""
LATE = 0.03
"""Limit in s of the age of the newest pose when it arrives."""
SILENCE = 0.2
"""Limit in s of the time between two poses."""
OUTLIERS, OUTLIER_DISTANCE = 0.02, 0.1
"""Limit of the share of poses that are farther than this (m) from the estimate."""
CELL_WARNING, CELL_LAND, CELL_FULL = 3.45, 3.275, 4.25
"""V per cell, for a battery whose limits are not in the log."""


def weak_motor(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find a motor that is commanded more thrust than each of the others."""
    if not has(topics, "actuators", *THRUSTS):
        return
    series = topics["actuators"]
    time, mean = blocks(series.time, series.rows(THRUSTS), spans, means)
    for k, motor in enumerate(MOTORS):
        others = np.delete(mean, k, axis=1)
        usual = np.median(others, axis=1)
        usual = np.where(usual > 0.0, usual, np.nan)  # no thrust commanded: nothing to compare
        excess = mean[:, k] / usual - 1.0
        spread = np.abs(others / usual[:, None] - 1.0).max(axis=1, initial=0.0)
        only = np.where(excess > 2.0 * spread, excess, 0.0)  # a shifted mass loads two motors
        for start, end in longest(time, only, WEAK_MOTOR, 2):
            worst = float(np.median(only[(time >= start) & (time < end)]))
            yield Finding(
                "motor_weak",
                worst / WEAK_MOTOR,
                start=start,
                end=end,
                claim=f"The {motor} motor needed {100 * worst:.0f} % more thrust commanded than "
                f"the others: it gives about {100 * (1 - 1 / (1 + worst)):.0f} % less than "
                "commanded.",
                signals=tuple(f"thrust.{name}" for name in MOTORS),
                label=f"thrust commanded of the {motor} motor over the others",
                unit="%",
                limit=100 * WEAK_MOTOR,
                time=time + BLOCK / 2,
                values=100 * excess,
            )


def vibration(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find strong vibration of the accelerometer."""
    if not has(topics, "imu", *FORCE) or len(topics["imu"]) < 3:
        return
    series = topics["imu"]
    period = float(np.median(np.diff(series.time)))
    if period <= 0.0 or 1.0 / period < 5.0 * VIBRATION_FROM:
        return  # too few samples to separate vibration from motion
    size = round(1.0 / (period * VIBRATION_FROM))
    if len(series) < size:
        return  # shorter than the smoothing window
    kernel = np.full(size, 1.0 / size)
    fast = [
        one - np.convolve(one, kernel, "same")
        for one in (series.values(name).astype(float) for name in FORCE)
    ]
    time, rms = blocks(series.time, np.stack(fast, axis=1), spans, rms_of)
    worst = rms.max(axis=1, initial=0.0)
    for start, end in longest(time, worst, VIBRATION, 2):
        most = float(np.median(worst[(time >= start) & (time < end)]))
        yield Finding(
            "vibration",
            most / VIBRATION,
            start=start,
            end=end,
            claim=f"The accelerometer vibrated with {most:.1f} m/s² rms above {VIBRATION_FROM:g} "
            f"Hz (limit {VIBRATION:g} m/s²).",
            signals=tuple(f"imu/{name}" for name in FORCE),
            label=f"acceleration above {VIBRATION_FROM:g} Hz, rms",
            unit="m/s²",
            limit=VIBRATION,
            time=time + BLOCK / 2,
            values=worst,
        )


def tracker_late(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find poses that are old when they arrive."""
    if not has(topics, "estimator", "measurement_age"):
        return
    series = topics["estimator"]
    age = series.values("measurement_age")[:, None]
    time, youngest = blocks(series.time, age, spans, lowest)
    late = youngest[:, 0]
    for gap, length in _silences(topics):  # during a silence, age is not lateness
        late = np.where((time < gap + length) & (time + BLOCK > gap), 0.0, late)
    for start, end in longest(time, late, LATE, 2):
        most = float(np.median(late[(time >= start) & (time < end)]))
        yield Finding(
            "tracker_late",
            most / LATE,
            start=start,
            end=end,
            claim=f"Measurements were {1e3 * most:.0f} ms old when they arrived, for "
            f"{end - start:.0f} s (limit {1e3 * LATE:.0f} ms).",
            signals=("measurement.age",),
            label="age of the newest measurement",
            unit="ms",
            limit=1e3 * LATE,
            time=series.time,
            values=1e3 * age[:, 0],
        )


def tracker_gaps(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find periods in which the tracker sent nothing."""
    found = [(t, s) for t, s in _silences(topics) if overlaps(spans, t, t + s)]
    if not found:
        return
    longest = max(length for _, length in found)
    times = f"{len(found)} times, longest" if len(found) > 1 else "once, for"
    starts, lengths = np.array(found).T
    time = topics[tracker_of(topics)[0]].time
    yield Finding(
        "tracker_gaps",
        longest / SILENCE,
        start=float(starts[0]),
        end=float(starts[-1] + lengths[-1]),
        claim=f"The tracker sent nothing {times} {longest:.2f} s (limit {SILENCE:g} s).",
        signals=("measurement.age",),
        label="time between two poses",
        unit="s",
        limit=SILENCE,
        time=time[1:],
        values=np.diff(time),
        follows=any(overlaps(flagged(topics, "link_lost"), t, t + s) for t, s in found),
    )


def tracker_outliers(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find single poses far from the estimate, while most are near it."""
    topic, fields = tracker_of(topics)
    if not has(topics, topic, *fields) or not has(topics, "state", *POSITION):
        return
    state, seen = topics["state"], topics[topic]
    distance = distances(seen, fields, state, POSITION)
    time, share = blocks(seen.time, distance[:, None], spans, _outlying)
    far = share[:, 0]
    for start, end in longest(time, far, OUTLIERS, 1):
        inside = (seen.time >= start) & (seen.time < end)
        most = float(np.mean(far[(time >= start) & (time < end)]))
        yield Finding(
            "tracker_outliers",
            most / OUTLIERS,
            start=start,
            end=end,
            claim=f"{100 * most:.0f} % of the tracker's poses were far from the estimate while "
            f"most were near it, up to {float(np.nanmax(distance[inside])):.2f} m.",
            signals=(*(f"{topic}/{name}" for name in fields), *axes("state.position")),
            label="distance between pose and estimate",
            unit="m",
            limit=OUTLIER_DISTANCE,
            time=seen.time,
            values=distance,
        )


def link_lost(topics: Topics, parameters: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find losses of the link during the flight."""
    lost = [s for s in flagged(topics, "link_lost") if overlaps(spans, *s)]
    if not lost:
        return
    allowed = number(parameters, "safety.link_timeout", 0.4)
    longest = max(end - start for start, end in lost) + allowed
    times = f"{len(lost)} times, longest for" if len(lost) > 1 else "for"
    yield Finding(
        "link_lost",
        longest / allowed,
        start=lost[0][0],
        end=lost[-1][1],
        claim=f"The link to the station was lost {times} {longest:.1f} s "
        f"(the vehicle reacts after {allowed:g} s).",
        signals=("link.age", "measurement.age"),
        label="link lost",
        unit="0 or 1",
        limit=0.5,
        time=np.repeat(np.ravel(lost), 2),
        values=np.tile([0.0, 1.0, 1.0, 0.0], len(lost)),
    )


def battery_sag(topics: Topics, parameters: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find a battery voltage below its warning."""
    if not has(topics, "battery", "voltage"):
        return
    series = topics["battery"]
    volts = series.values("voltage")
    cells = max(1, int(np.ceil(np.nanmax(volts, initial=0.0) / CELL_FULL)))
    warning = number(parameters, "safety.battery_warning", cells * CELL_WARNING)
    landing = min(number(parameters, "safety.battery_land", cells * CELL_LAND), warning - 0.1)
    known = "safety.battery_warning" in parameters
    assumed = "" if known else f" ({CELL_WARNING:g} V a cell; {cells} cells assumed)"
    whole = [(start - SETTLING, end + SETTLING) for start, end in spans]
    inside = within(series.time, whole) & (volts < warning) & (volts > 0.3 * warning)
    times = series.time[inside]
    if len(times) < 2 or times[-1] - times[0] < 1.0:
        return
    least = float(np.min(volts[inside]))
    yield Finding(
        "battery_sag",
        1.0 + (warning - least) / (warning - landing),
        start=float(times[0]),
        end=float(times[-1]),
        claim=f"The battery fell to {least:.1f} V, below its warning of {warning:.1f} V{assumed}.",
        signals=("battery.voltage",),
        label="battery",
        unit="V",
        limit=warning,
        time=series.time,
        values=volts,
    )


def _silences(topics: Topics) -> Spans:
    """Return start and length (s) of the tracker's silences."""
    topic, _ = tracker_of(topics)
    if not has(topics, topic):
        return []
    time = topics[topic].time
    ends = np.flatnonzero(np.diff(time) > SILENCE).tolist()
    return [(float(time[k]), float(time[k + 1] - time[k])) for k in ends]


def _outlying(rows: Array) -> Array:
    """Return the share of poses that are far from the estimate while most are near it."""
    limit = np.maximum(OUTLIER_DISTANCE, 5.0 * np.median(rows, axis=0))
    share: Array = (rows > limit).mean(axis=0)
    return share
