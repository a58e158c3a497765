"""Findings about sensors that repeat themselves, are cut off, or have gaps.

A reading that stays the same to the last digit is not a measurement: noise moves the last digit of
each sensor of a vehicle in flight.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from console.evaluation.findings import Array, Finding, Parameters, Spans, Topics, stretches, within
from extensions.explanation.blocks import blocks, has, longest, medians
from flight_log.fields import FORCE, POSITION, RATE, TRACKED, TRACKED_ATTITUDE

FROZEN, JUMP = 0.15, 0.1
"""Limit in s of poses that are the same to the last digit; and in m, or of a quaternion's entry,
of a jump before them, which another body's pose has."""
STUCK, STUCK_SAMPLES = 0.12, 60
"""Limits in s and in samples of equal readings of one axis of the IMU; calm axes in whole counts
stay the same for up to 26 samples at 500 Hz."""
STILL_PRESSURE = 1.0
"""Limit in s of equal pressures."""
BAROMETER, PASCALS = 1.0, 11.8
"""Limit in m of the barometric height against the estimated one, and Pa for a metre."""
STILL_VOLTAGE = 5.0
"""Limit in s of equal voltages, among them those before and after a take-off or a landing."""
STARTED, STOPPED = 2.0, 0.4
"""Time in s after a take-off and after a landing within which the current moves the voltage."""
ENDED = 1.0
"""Least time in s of a flight that the end of the log cuts off."""
MISSING = 0.01
"""Limit of the share of the IMU's samples that are missing."""
ABOUT = 1.0
"""Time in s before and after a stretch in which a cut-off axis reads nothing larger."""


class Repeated(NamedTuple):
    """The longest stretch of equal readings: its times in s, the number of them, the first row."""

    start: float
    end: float
    number: int
    first: int


def repeated(time: Array, rows: Array) -> Repeated:
    """Return the longest stretch of rows (N, K) that are equal to the last digit.

    It is empty where all are: there nothing was measured.
    """
    equal = (np.diff(rows, axis=0) == 0.0).all(axis=1)
    same = np.concatenate([[False], equal & ~equal.all(), [False]])
    edges = np.diff(same.astype(np.int8))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    if not len(starts):
        return Repeated(0.0, 0.0, 0, 0)
    longest = int(np.argmax(ends - starts))
    first, last = int(starts[longest]), int(ends[longest])
    return Repeated(float(time[first]), float(time[last]), last - first + 1, first)


def tracker_frozen(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find poses, positions or attitudes that a tracker repeats with new stamps."""
    if not has(topics, "tracker_pose", *TRACKED, *TRACKED_ATTITUDE):
        return
    series = topics["tracker_pose"]
    fresh = np.concatenate([[True], np.diff(series.time) > 0.0]) & within(series.time, spans)
    time = series.time[fresh]
    for names, what in ((TRACKED, "positions"), (TRACKED_ATTITUDE, "attitudes")):
        rows = series.rows(names)[fresh]
        same = repeated(time, rows)
        if same.end - same.start < FROZEN:
            continue
        jump = np.abs(rows[same.first] - rows[max(same.first - 1, 0)]).max()
        if jump > JUMP:  # of another body that rests, or of a restarted system
            return
        yield _finding(
            "tracker_frozen",
            same,
            FROZEN,
            f"The tracker repeated its last {what} for {same.end - same.start:.2f} s, the same to "
            "the last digit, with new stamps.",
            tuple(f"tracker_pose/{name}" for name in names),
        )
        return


def imu_stuck(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find an axis of the IMU that repeats its reading, or is cut off at the end of its range."""
    if not has(topics, "imu", *FORCE, *RATE):
        return
    series = topics["imu"]
    inside = within(series.time, spans)
    time = series.time[inside]
    for name in FORCE + RATE:
        values = series.values(name)[inside]
        same = repeated(time, values[:, None])
        if same.number < STUCK_SAMPLES or same.end - same.start < STUCK:
            continue
        # A cut-off axis returns, and never reads more than that about this time.
        about = (time > same.start - ABOUT) & (time < same.end + ABOUT)
        size = np.abs(values[about])
        is_cut = same.end < time[-1] - STUCK and size.max() <= abs(values[same.first])
        kind = "imu_clipped" if is_cut else "imu_stuck"
        sensor = "accelerometer" if name in FORCE else "gyroscope"
        axis = name[-1]
        claim = (
            f"The {axis} axis of the {sensor} was cut off at {values[same.first]:.3g}, for up to "
            f"{same.end - same.start:.2f} s: its range is too small for this flight."
            if kind == "imu_clipped"
            else f"The {axis} axis of the {sensor} kept one reading for "
            f"{same.end - same.start:.2f} s, the same to the last digit."
        )
        yield _finding(kind, same, STUCK, claim, (f"imu/{name}",))
        return


def imu_gaps(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find samples of the IMU that are missing."""
    if "imu" not in topics or len(topics["imu"]) < 3:
        return
    time = topics["imu"].time
    steps = np.diff(time)
    usual = float(np.median(steps))
    inside = within(time[1:], spans) | within(time[:-1], spans)  # a gap may end the flight
    if usual <= 0.0 or not inside.any():
        return
    lost = np.where(inside, np.round(steps / usual) - 1.0, 0.0).clip(min=0.0)
    share = float(lost.sum() / (lost.sum() + inside.sum()))
    if share < MISSING:
        return
    where = np.flatnonzero(lost > 0.0)
    yield Finding(
        kind="imu_gaps",
        weight=share / MISSING,
        start=float(time[where[0]]),
        end=float(time[where[-1] + 1]),
        claim=f"{100 * share:.1f} % of the IMU's samples are missing, {len(where)} times, at most "
        f"{1e3 * steps[where].max():.0f} ms: check the board's link and its rate.",
        signals=("imu/linear_acceleration.z",),
        label="time between two samples",
        unit="s",
        limit=1.5 * usual,
        time=time[1:],
        values=steps,
    )


def ended_in_flight(topics: Topics, _: Parameters, __: Spans) -> Iterator[Finding]:
    """Find a log that ends before its flight does."""
    if not has(topics, "status", "airborne"):
        return
    status = topics["status"]
    flown = stretches(status.time, status.values("airborne") > 0.5)
    if flown and flown[-1][1] == status.time[-1] and flown[-1][1] - flown[-1][0] > ENDED:
        end = float(status.time[-1])
        yield _finding(
            "ended_in_flight",
            Repeated(end - ENDED, end, 0, 0),
            ENDED,
            "The log ends in flight: the board, its link or the recorder has failed.",
            (),
        )


def barometer_stuck(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find a barometer that repeats its reading."""
    if not has(topics, "pressure", "fluid_pressure"):
        return
    series = topics["pressure"]
    inside = within(series.time, spans)
    same = repeated(series.time[inside], series.values("fluid_pressure")[inside][:, None])
    if same.end - same.start >= STILL_PRESSURE:
        yield _finding(
            "barometer_stuck",
            same,
            STILL_PRESSURE,
            f"The barometer kept one reading for {same.end - same.start:.1f} s, the same to the "
            "last digit: its port is blocked, or it hangs.",
            ("pressure/fluid_pressure",),
        )


def barometer_off(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find a barometric height that leaves the estimated one, by a step or steadily."""
    if not has(topics, "pressure", "fluid_pressure") or not has(topics, "state", POSITION[2]):
        return
    series, state = topics["pressure"], topics["state"]
    height = np.interp(series.time, state.time, state.values(POSITION[2]))
    away = -series.values("fluid_pressure").astype(np.float64) / PASCALS - height
    starts, middle = blocks(series.time, away[:, None], spans, medians, 1.0)
    if len(starts) < 2:
        return
    moved = middle[:, 0] - np.median(middle[:2, 0])
    for start, end in longest(starts, np.abs(moved), BAROMETER, 2, 1.0):
        inside = (starts >= start) & (starts < end)
        most = float(moved[inside][np.argmax(np.abs(moved[inside]))])
        steps = np.abs(np.diff(moved))
        how = "at once" if steps.max() > 0.6 * abs(most) else "steadily"
        yield Finding(
            kind="barometer_off",
            weight=abs(most) / BAROMETER,
            start=start,
            end=end,
            claim=f"The barometric height left the estimated one by {most:+.1f} m, {how}.",
            alike=("a door", "the weather", "a leaking port", "wind over it"),
            signals=("pressure/fluid_pressure",),
            label="barometric height minus the estimated one, since the start",
            unit="m",
            limit=BAROMETER,
            time=starts + 0.5,
            values=moved,
        )


def battery_stuck(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find a voltage that stays the same while the motors start or stop, which moves it."""
    if not has(topics, "battery", "voltage") or not has(topics, "status", "airborne"):
        return
    series, status = topics["battery"], topics["status"]
    same = repeated(series.time, series.values("voltage")[:, None])
    if not spans or same.end - same.start < STILL_VOLTAGE:
        return
    airborne = np.diff(status.values("airborne"))
    started, stopped = status.time[1:][airborne > 0.0], status.time[1:][airborne < 0.0]
    moved = [at for at in started if same.start < at and at + STARTED < same.end]
    moved += [at for at in stopped if same.start < at - STARTED and at + STOPPED < same.end]
    if moved:
        yield _finding(
            "battery_stuck",
            same,
            STILL_VOLTAGE,
            f"The battery's voltage stayed the same for {same.end - same.start:.0f} s, although "
            "the motors' current changed: its meter does not measure.",
            ("battery.voltage",),
        )


def _finding(
    kind: str, same: Repeated, limit: float, claim: str, signals: tuple[str, ...]
) -> Finding:
    return Finding(
        kind=kind,
        weight=(same.end - same.start) / limit,
        start=same.start,
        end=same.end,
        claim=claim,
        signals=signals,
        label="repeats itself",
        unit="0 or 1",
        limit=0.5,
        time=np.repeat([same.start, same.end], 2),
        values=np.array([0.0, 1.0, 1.0, 0.0]),
    )
