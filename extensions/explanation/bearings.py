"""Findings about bearings: a beacon off, all of them off, a vehicle that left them by itself."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from console.evaluation.findings import Finding, Parameters, Spans, Topics, flagged, within
from extensions.explanation.blocks import BLOCK, blocks, has, longest, means, overlaps
from flight_log.fields import ATTITUDE, POSITION, TRACKED, TRACKED_ATTITUDE, axes
from quadrotor.plain_rotations import rotation_vectors_between

BEACON_OFF = 1.0
"""deg between the bearings of a beacon and those expected from the others."""
TURNED, MOVED = 1.5, 0.1
"""deg and m between the estimate on bearings and the tracker's poses, on average."""
FELL_BACK = "fell back to the tracker"
"""Begin of the vehicle's event."""


def beacon_off(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find a beacon whose bearings do not fit the others."""
    suspected = [s for s in flagged(topics, "beacon_off") if overlaps(spans, *s)]
    if not suspected or not has(topics, "status", "suspect_offset", "suspect_beacon"):
        return
    series = topics["status"]
    offset = np.degrees(series.values("suspect_offset"))
    start, end = suspected[0][0], suspected[-1][1]
    inside = (series.time >= start) & (series.time <= end)
    worst = np.nan_to_num(np.where(inside, offset, -1.0), nan=-1.0).argmax()
    most, beacon = float(offset[worst]), int(series.values("suspect_beacon")[worst])
    yield Finding(
        "beacon_off",
        max(1.0, most / BEACON_OFF),
        start=start,
        end=end,
        claim=f"Bearings of beacon {beacon} were {most:.1f}° off those of the others: it is "
        "not where the layout says, or its bearings are biased.",
        signals=("status/suspect_offset", "status/suspect_beacon"),
        label=f"offset of beacon {beacon}",
        unit="°",
        limit=BEACON_OFF,
        time=series.time,
        values=offset,
    )


def bearings_disagree(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find a flight on bearings whose estimate is turned or moved against the tracker's poses."""
    if not has(topics, "tracker_pose", *TRACKED, *TRACKED_ATTITUDE):
        return
    if not has(topics, "state", *POSITION, *ATTITUDE):
        return
    state, seen = topics["state"], topics["tracker_pose"]
    flown = [s for s in flagged(topics, "on_bearings") if overlaps(spans, *s)]
    near = np.searchsorted(state.time, seen.time).clip(max=len(state) - 1)
    believed, tracked = state.rows(ATTITUDE)[near], seen.rows(TRACKED_ATTITUDE)
    known = (np.linalg.norm(believed, axis=1) > 0.5) & (np.linalg.norm(tracked, axis=1) > 0.5)
    use = known & within(seen.time, flown)
    if not use.any():
        return
    time = seen.time[use]
    turn = rotation_vectors_between(believed[use], tracked[use])
    moved = state.rows(POSITION)[near][use] - seen.rows(TRACKED)[use]
    cut = [(max(a, b), min(c, d)) for a, c in flown for b, d in spans if max(a, b) < min(c, d)]
    starts, mean = blocks(time, np.hstack([np.degrees(turn), moved]), cut, means)
    angle, away = (np.linalg.norm(part, axis=1) for part in (mean[:, :3], mean[:, 3:]))
    weight = np.maximum(angle / TURNED, away / MOVED)
    for start, end in longest(starts, weight, 1.0, 2):
        inside = (starts >= start) & (starts < end)
        yield Finding(
            "bearings_disagree",
            float(np.median(weight[inside])),
            start=start,
            end=end,
            claim=f"The estimate on bearings was turned by {np.median(angle[inside]):.1f}° and "
            f"moved by {np.median(away[inside]):.2f} m against the tracker's poses: the beacon "
            "layout or the bearings' frame does not fit the tracker's world.",
            signals=(*axes("state.position"), "state.yaw"),
            label="rotation or distance over its limit",
            unit="",
            limit=1.0,
            time=starts + BLOCK / 2,
            values=weight,
            follows=any(overlaps([one], start, end) for one in flagged(topics, "beacon_off")),
        )


def fell_back(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find where the vehicle stopped flying on bearings by itself."""
    fallen = [s for s in flagged(topics, "fell_back") if overlaps(spans, *s)]
    if not fallen:
        return
    events = topics["events"].changes("msg") if "events" in topics else []
    text = next((text for _, text in events if text.startswith(FELL_BACK)), FELL_BACK)
    times = f" ({len(fallen)} times)" if len(fallen) > 1 else ""
    yield Finding(
        "fell_back",
        1.0,
        start=fallen[0][0],
        end=fallen[-1][1],
        claim=f"The vehicle {text}{times}.",
        signals=("consistency", "refused.share"),
        label="fell back",
        unit="0 or 1",
        limit=0.5,
        time=np.repeat(np.ravel(fallen), 2),
        values=np.tile([0.0, 1.0, 1.0, 0.0], len(fallen)),
    )
