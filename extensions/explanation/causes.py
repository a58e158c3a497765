"""Findings that can cause others: a weak motor, vibration, the tracker, the link."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from console.evaluation.findings import Array, Finding, Parameters, Spans, Topics, flagged
from extensions.explanation.blocks import (
    BLOCK,
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
from flight_log.fields import FORCE, POSITION, RATE, THRUSTS, axes
from quadrotor.constants import MOTORS

YAWING = np.array([1.0, -1.0, 1.0, -1.0])
"""Signs of the torque about z by the motors' thrusts."""
WEAK_MOTOR = 0.06
"""Limit of the thrust commanded of one motor relative to the others, minus 1."""
VIBRATION, VIBRATION_FROM = 2.5, 15.0
"""Limit in m/s² rms on one axis of the accelerometer, above this frequency in Hz."""
GROWN, LEAST_VIBRATION = 3.0, 0.8
"""Factor over the calmest part of a flight from which on less vibration counts, and its limit."""
LATE = 0.03
"""Limit in s of the age of the newest pose when it arrives."""
SHORT = 0.5
"""Time in s over which ages and vibration are taken: a flight ends within seconds of them."""
SILENCE = 0.2
"""Limit in s of the time between two poses."""
OUTLIERS, OUTLIER_DISTANCE = 0.02, 0.1
"""Limit of the share of poses that are farther than this (m) from the estimate."""
NEIGHBOURS = 9
"""Number of poses, in an odd window about each, most of which are no outliers."""


def weak_motor(topics: Topics, parameters: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find a motor that is commanded more thrust than each of the others, or less."""
    if not has(topics, "actuators", *THRUSTS):
        return
    series = topics["actuators"]
    yaw = _thrust_of_yaw(topics, parameters)[:, None] * YAWING
    time, mean = blocks(series.time, series.rows(THRUSTS) - yaw, spans, means)
    for k, motor in enumerate(MOTORS):
        others = np.delete(mean, k, axis=1)
        usual = np.median(others, axis=1)
        usual = np.where(usual > 0.0, usual, np.nan)  # no thrust commanded: nothing to compare
        excess = mean[:, k] / usual - 1.0
        spread = np.abs(others / usual[:, None] - 1.0).max(axis=1, initial=0.0)
        only = np.where(np.abs(excess) > 2.0 * spread, excess, 0.0)  # a shifted mass loads two
        for kind, size in (("motor_weak", only), ("motor_strong", -only)):
            for start, end in longest(time, size, WEAK_MOTOR, 2):
                worst = float(np.median(size[(time >= start) & (time < end)]))
                is_weak = kind == "motor_weak"
                gives = abs(1.0 - 1.0 / (1.0 + (worst if is_weak else -worst)))
                yield Finding(
                    kind,
                    worst / WEAK_MOTOR,
                    start=start,
                    end=end,
                    claim=f"The {motor} motor needed {100 * worst:.0f} % "
                    f"{'more' if is_weak else 'less'} thrust commanded than the others: it gives "
                    f"about {100 * gives:.0f} % {'less' if is_weak else 'more'} than commanded.",
                    signals=tuple(f"thrust.{name}" for name in MOTORS),
                    label=f"thrust commanded of the {motor} motor over the others",
                    unit="%",
                    limit=100 * WEAK_MOTOR,
                    time=time + BLOCK / 2,
                    values=100 * excess,
                )


def _thrust_of_yaw(topics: Topics, parameters: Parameters) -> Array:
    """Return the thrust (N) of each motor that changes the rate about z, at the actuators' times;
    0 where it is not known.
    """
    time = topics["actuators"].time
    inertia, ratio = (number(parameters, f"model.{k}", 0.0) for k in ("inertia_zz", "torque_ratio"))
    if ratio == 0.0 or len(time) < 2 or not has(topics, "imu", RATE[2]):
        return np.zeros(len(time))
    imu = topics["imu"]
    found: Array = np.gradient(np.interp(time, imu.time, imu.values(RATE[2])), time)
    return found * inertia / (4.0 * ratio)


def vibrating(topics: Topics, spans: Spans) -> tuple[Array, Array]:
    """Return the starts (s) of the blocks of flight, and the rms of the accelerometer's vibration
    (m/s², on its worst axis) in each; both are empty without samples that show it.
    """
    nothing = np.zeros(0), np.zeros(0)
    if not has(topics, "imu", *FORCE) or len(topics["imu"]) < 3:
        return nothing
    series = topics["imu"]
    period = float(np.median(np.diff(series.time)))
    if period <= 0.0 or 1.0 / period < 5.0 * VIBRATION_FROM:
        return nothing  # too few samples to separate vibration from motion
    size = round(1.0 / (period * VIBRATION_FROM))
    if len(series) < size:
        return nothing  # shorter than the smoothing window
    kernel = np.full(size, 1.0 / size)
    fast = [
        one - np.convolve(one, kernel, "same")
        for one in (series.values(name).astype(float) for name in FORCE)
    ]
    time, rms = blocks(series.time, np.stack(fast, axis=1), spans, rms_of, SHORT)
    return time, rms.max(axis=1, initial=0.0)


def vibration(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find vibration of the accelerometer that is strong, or has grown."""
    time, worst = vibrating(topics, spans)
    calm = float(worst.min(initial=VIBRATION))
    limit = min(VIBRATION, max(LEAST_VIBRATION, GROWN * calm))
    for start, end in longest(time, worst, limit, 2, SHORT):
        most = float(np.median(worst[(time >= start) & (time < end)]))
        yield Finding(
            "vibration",
            most / limit,
            start=start,
            end=end,
            claim=f"The accelerometer vibrated with {most:.1f} m/s² rms above {VIBRATION_FROM:g} "
            f"Hz (limit {limit:.2g} m/s²; the calmest part of the flight {calm:.2g} m/s²).",
            signals=tuple(f"imu/{name}" for name in FORCE),
            label=f"acceleration above {VIBRATION_FROM:g} Hz, rms",
            unit="m/s²",
            limit=limit,
            time=time + SHORT / 2,
            values=worst,
        )


def tracker_late(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find poses that are old when they arrive."""
    if not has(topics, "estimator", "measurement_age"):
        return
    series = topics["estimator"]
    age = series.values("measurement_age")[:, None]
    time, youngest = blocks(series.time, age, spans, lowest, SHORT)
    late = youngest[:, 0]
    for gap, length in _silences(topics):  # during a silence, age is not lateness
        late = np.where((time < gap + length) & (time + SHORT > gap), 0.0, late)
    for start, end in longest(time, late, LATE, 2, SHORT):
        most = float(np.median(late[(time >= start) & (time < end)]))
        yield Finding(
            "tracker_late",
            most / LATE,
            start=start,
            end=end,
            claim=f"Measurements were {1e3 * most:.0f} ms old when they arrived, for "
            f"{end - start:.1f} s (limit {1e3 * LATE:.0f} ms).",
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
    # Where it is the estimate that errs, the poses still agree with those next to them.
    distance = np.fmin(distances(seen, fields, state, POSITION), _apart(seen.rows(fields)))
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
            claim=f"{100 * most:.0f} % of the tracker's poses were far from the estimate and from "
            f"the poses next to them, up to {float(np.nanmax(distance[inside])):.2f} m.",
            signals=(*(f"{topic}/{name}" for name in fields), *axes("state.position")),
            label="distance of the pose from the estimate and from those next to it",
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


def _silences(topics: Topics) -> Spans:
    """Return start and length (s) of the tracker's silences."""
    topic, _ = tracker_of(topics)
    if not has(topics, topic):
        return []
    time = topics[topic].time
    ends = np.flatnonzero(np.diff(time) > SILENCE).tolist()
    return [(float(time[k]), float(time[k + 1] - time[k])) for k in ends]


def _apart(places: Array) -> Array:
    """Return the distances (m) of places (N, 3) from the median of those about them."""
    about = np.pad(places.astype(np.float64), ((NEIGHBOURS // 2,) * 2, (0, 0)), mode="edge")
    middle = np.median(sliding_window_view(about, NEIGHBOURS, axis=0), axis=2)
    found: Array = np.linalg.norm(places - middle, axis=1)
    return found


def _outlying(rows: Array) -> Array:
    """Return the share of poses that are far away while most are near."""
    limit = np.maximum(OUTLIER_DISTANCE, 5.0 * np.median(rows, axis=0))
    share: Array = (rows > limit).mean(axis=0)
    return share
