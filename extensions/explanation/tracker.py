"""Findings about the tracker's messages: their order, stamps and rate, and poses elsewhere."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from console.evaluation.findings import Array, Finding, Parameters, Spans, Topics, flagged, within
from extensions.explanation.blocks import (
    BLOCK,
    blocks,
    distances,
    has,
    longest,
    means,
    medians,
    overlaps,
    tracker_of,
)
from flight_log.fields import ATTITUDE, POSITION, TRACKED, TRACKED_ATTITUDE
from quadrotor.plain_rotations import rotation_vectors_between

ELSEWHERE, TURNED = 0.15, 8.0
"""Limits in m and deg between a pose and the estimate."""
NEARLY_ALL, AT_ONCE = 0.9, 0.25
"""Share of the poses of such a time (s) that are elsewhere, beyond which they are no outliers. An
estimate follows poses that agree with each other after 0.5 s."""
UNUSED = 0.15
"""Limit of the share of poses that the vehicle ignored because of their stamps."""
REPEATED = 0.05
"""Limit of the share of poses that arrive twice."""
SLOW = 0.5
"""Limit of the rate of the poses over the flight's usual one."""
FEWEST = 10
"""Poses in a block below which nothing is said about it."""


def tracker_moved(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find poses that are all elsewhere, or turned, from some time on."""
    if not has(topics, "tracker_pose", *TRACKED, *TRACKED_ATTITUDE):
        return
    if not has(topics, "state", *POSITION, *ATTITUDE):
        return
    state, seen = topics["state"], topics["tracker_pose"]
    away = distances(seen, TRACKED, state, POSITION)
    near = np.searchsorted(state.time, seen.time).clip(max=len(state) - 1)
    believed, tracked = state.rows(ATTITUDE)[near], seen.rows(TRACKED_ATTITUDE)
    known = (np.linalg.norm(believed, axis=1) > 0.5) & (np.linalg.norm(tracked, axis=1) > 0.5)
    turn = np.zeros(len(seen))
    vectors = rotation_vectors_between(believed[known], tracked[known])
    turn[known] = np.degrees(np.linalg.norm(vectors, axis=1))
    size = np.fmax(np.nan_to_num(away) / ELSEWHERE, turn / TURNED)
    far = (size > 1.0).astype(np.float64)
    ends = [(start, end + BLOCK) for start, end in spans]  # a flight may end by it
    on_bearings = flagged(topics, "on_bearings")  # then it is the estimate that may be elsewhere
    starts, share = blocks(seen.time, far[:, None], ends, means, AT_ONCE)
    for start, end in longest(starts, share[:, 0], NEARLY_ALL, 1, AT_ONCE):
        if overlaps(on_bearings, start, end):
            continue
        inside = (seen.time >= start) & (seen.time < end)
        metres, degrees = float(np.median(away[inside])), float(np.median(turn[inside]))
        yield Finding(
            kind="tracker_moved",
            weight=float(np.median(size[inside])),
            start=start,
            end=end,
            claim=f"All poses were {metres:.2f} m and {degrees:.0f}° away from the estimate for "
            f"{end - start:.1f} s.",
            alike=("another origin, axes or handedness", "another body", "a wrong estimate"),
            signals=tuple(f"tracker_pose/{name}" for name in TRACKED),
            label="distance of the poses over its limit",
            unit="",
            limit=1.0,
            time=seen.time,
            values=size,
        )


def tracker_stamped_wrong(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find poses that arrive and are ignored because of their stamps, or twice, or out of order."""
    topic = tracker_of(topics)[0]
    if topic not in topics or flagged(topics, "on_bearings"):
        return
    time = topics[topic].time
    twice = within(time[1:], spans) & (np.diff(time) <= 0.0)
    arrived = int(within(time, spans).sum())
    if arrived > FEWEST and twice.sum() > REPEATED * arrived:
        at = time[1:][twice]
        doubled = float(twice.sum()) / arrived
        yield _finding(
            "tracker_repeated",
            (doubled / REPEATED, float(at[0]), float(at[-1])),
            f"{100 * doubled:.0f} % of the poses arrived twice with the same stamp: two senders, "
            "or a network with two paths.",
            time[1:],
            (np.diff(time) <= 0.0).astype(np.float64),
        )
    if not has(topics, "estimator", "measurements_used", "measurements_ignored"):
        return
    series = topics["estimator"]
    counts = series.rows(("measurements_used", "measurements_ignored")).astype(np.float64)
    longer = [(start, end + BLOCK) for start, end in spans]
    starts, grown = blocks(series.time, counts, longer, _growth, 1.0)
    heard = np.array([((time >= one) & (time < one + 1.0)).sum() for one in starts])
    total = grown.sum(axis=1)
    share = np.where((heard >= FEWEST) & (total > 0.0), grown[:, 1] / np.maximum(total, 1.0), 0.0)
    for start, end in longest(starts, share, UNUSED, 1, 1.0):
        inside = (starts >= start) & (starts < end)
        most = float(np.max(share[inside]))
        all_of_them = most > NEARLY_ALL
        yield _finding(
            "tracker_clock" if all_of_them else "tracker_disordered",
            (most / UNUSED, start, end),
            f"Poses arrived and {'all of them' if all_of_them else f'{100 * most:.0f} % of them'} "
            "were ignored because of their stamps: "
            + (
                "the tracker's clock was set, runs at another rate, or is not synchronised."
                if all_of_them
                else "they arrived behind later ones."
            ),
            starts,
            share,
        )


def tracker_slow(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find stretches in which poses arrive regularly, and less often than in the rest of it."""
    topic = tracker_of(topics)[0]
    if topic not in topics:
        return
    time = topics[topic].time
    time = time[np.concatenate([[True], np.diff(time) > 0.0])]
    steps = np.append(np.diff(time), np.inf)
    starts, found = blocks(time, steps[:, None], spans, medians)
    if not len(starts):
        return
    rate = 1.0 / np.maximum(found[:, 0], 1e-6)
    usual = float(np.max(rate))
    slower = np.where(rate > 0.0, usual / np.maximum(rate, 1e-6), 0.0)
    for start, end in longest(starts, slower, 1.0 / SLOW, 2):
        least = float(np.median(rate[(starts >= start) & (starts < end)]))
        yield _finding(
            "tracker_slow",
            (usual * SLOW / least, start, end),
            f"The tracker sent {least:.0f} poses a second, {usual:.0f} before or after.",
            starts + BLOCK / 2,
            rate,
        )


def _growth(rows: Array) -> Array:
    found: Array = (rows[-1] - rows[0]).clip(min=0.0)
    return found


def _finding(
    kind: str, figures: tuple[float, float, float], claim: str, time: Array, values: Array
) -> Finding:
    weight, start, end = figures
    return Finding(
        kind=kind,
        weight=weight,
        start=start,
        end=end,
        claim=claim,
        signals=("measurement.age",),
        label=kind.replace("_", " "),
        unit="",
        limit=UNUSED,
        time=time,
        values=values,
    )
