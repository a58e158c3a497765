"""Findings about bearings against the tracker's poses: swapped, distorted, scattered, off.

A bearing is compared with the direction from the pose to the beacon's place in the layout. What
remains has a shape for each cause: two beacons that see each other's direction, an angle that grows
away from the sensor's axis, one beacon alone, or scatter beyond the stated standard deviation.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from bearing_sim.beacons import parse_layout
from console.evaluation.findings import Array, Finding, Parameters, Spans, Topics, within
from extensions.explanation.blocks import blocks, has, longest, medians
from flight_log.fields import ATTITUDE, POSITION, TRACKED, TRACKED_ATTITUDE
from quadrotor.errors import MeasurementError
from quadrotor.plain_rotations import matrices_of

FEWEST = 60
"""Number of frames below which nothing is said."""
SWAPPED = 8.0
"""deg: a bearing this far from its own beacon, and nearer to another one's direction."""
OFF, DISTORTED = 2.0, 1.0
"""Limits in deg of the mean offset of one beacon, and of those of all by a lens."""
EXPLAINED = 0.95
"""Least share of the beacons' mean offsets that a lens has to explain."""
SCATTER = 1.5
"""Limit of the scatter of the bearings over their stated standard deviation."""
OLDEST = 0.1
"""Longest time in s between a bearing and the pose that it is compared with."""
CONSISTENT = 1.35
"""Limit of the scatter of bearings around their own solved pose over the expected one."""
POSE = 6
"""Numbers of a pose, which take up as many of the bearings' two each."""
APART = 0.05
"""Limit in m between the tracker's poses and those of the bearings."""
PLACES = {"tracker_pose": (TRACKED, TRACKED_ATTITUDE), "bearing_pose": (POSITION, ATTITUDE)}
"""Fields of position and attitude by topic."""
MOUNT = ("bearings.mount_roll", "bearings.mount_pitch", "bearings.mount_yaw")


class Sightings(NamedTuple):
    """Measured and expected bearings; NaN where a beacon was not seen.

    Attributes:
        time: in s, (N,).
        ids: of the beacons of the layout, (K,).
        seen, expected: unit vectors in body axes, (N, K, 3).
        sigma: stated standard deviation in deg.
    """

    time: Array
    ids: list[int]
    seen: Array
    expected: Array
    sigma: float


def sightings(topics: Topics, parameters: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find the causes that the residuals of bearings against the poses show."""
    found = _compared(topics, parameters, spans)
    if found is None:
        return
    across, angle = _residuals(found)
    own = _compared(topics, parameters, spans, "bearing_pose")
    count = 2 * len(found.ids)
    expected = CONSISTENT * found.sigma * np.sqrt(max(1, count - POSE) / count)
    agree = own is not None and _scatter(_residuals(own)[1]) < expected
    if (swapped := _exchanged(found, angle)) is not None:
        yield swapped
        return
    sizes = np.linalg.norm(np.degrees(np.nanmean(across, axis=0)), axis=1)
    if (distorted := _distorted(found, angle, sizes)) is not None:
        yield distorted
    if agree:  # with each other; in a hover over the middle a lens looks like another height
        yield from _moved_apart(topics, spans)
    elif distorted is None:
        yield from _off_or_scattered(found, angle, sizes)


def _exchanged(found: Sightings, angle: Array) -> Finding | None:
    """Return the finding of two beacons whose identities are swapped, if there are any."""
    pair = _swapped(found, angle)
    if pair is None:
        return None
    one, other = pair
    most = float(np.nanmedian(angle[:, one][angle[:, one] > SWAPPED]))
    share = float(np.nanmean(angle[:, one] > SWAPPED))
    return _finding(
        "bearings_swapped",
        most / SWAPPED,
        f"Beacons {found.ids[one]} and {found.ids[other]} were seen in each other's direction, "
        f"in {100 * share:.0f} % of the frames: their identities are swapped.",
        found.time,
        angle[:, one],
    )


def _distorted(found: Sightings, angle: Array, sizes: Array) -> Finding | None:
    """Return the finding of a lens that turns all bearings, if there is one.

    Args:
        angle: from expected to seen, in deg, (N, K); sizes: of the beacons' mean offsets, in deg.
    """
    distortion, explained = _lens(found)
    if explained <= EXPLAINED or np.mean(sizes) <= DISTORTED:
        return None
    return _finding(
        "bearings_distorted",
        float(np.mean(sizes)) / DISTORTED,
        f"The bearings were distorted as by a lens: {100 * distortion:+.1f} % of their angle "
        "from the sensor's axis at 1 rad. Calibrate the camera.",
        found.time,
        np.nanmean(angle, axis=1),
    )


def _off_or_scattered(found: Sightings, angle: Array, sizes: Array) -> Iterator[Finding]:
    """Find one beacon that is not at its place, else bearings that scatter too much."""
    worst = int(np.argmax(sizes))
    others = np.delete(sizes, worst)
    scatter = _scatter(angle)
    if sizes[worst] > OFF and len(others) and sizes[worst] > 2.5 * others.max():
        yield _finding(
            "beacon_off",
            float(sizes[worst]) / OFF,
            f"Bearings of beacon {found.ids[worst]} were {sizes[worst]:.1f}° off on average "
            "against the tracker's poses: it is not where the layout says.",
            found.time,
            angle[:, worst],
        )
    elif found.sigma > 0.0 and scatter > SCATTER * found.sigma:
        yield _finding(
            "bearings_scattered",
            scatter / found.sigma / SCATTER,
            f"The bearings scattered by {scatter:.1f}°, {scatter / found.sigma:.1f} times their "
            "stated standard deviation: noise that lasts from frame to frame, or a wrong sigma.",
            found.time,
            np.nanmean(angle, axis=1),
        )


def _moved_apart(topics: Topics, spans: Spans) -> Iterator[Finding]:
    """Find poses of the tracker that leave those of bearings that agree with each other."""
    poses, own = topics["tracker_pose"], topics["bearing_pose"]
    near = np.searchsorted(poses.time, own.time).clip(max=len(poses) - 1)
    apart = own.rows(POSITION) - poses.rows(TRACKED)[near]
    starts, middle = blocks(own.time, apart, spans, medians)
    if len(starts) < 2:
        return
    away = np.linalg.norm(middle, axis=1)
    for start, end in longest(starts, away, APART, 2):
        most = float(away[(starts >= start) & (starts < end)].max())
        yield Finding(
            kind="tracker_against_bearings",
            weight=most / APART,
            start=start,
            end=end,
            claim=f"The tracker's poses and those of the bearings moved {most:.2f} m apart, and "
            "the bearings agree with each other.",
            alike=(
                "a tracker whose origin drifts",
                "its scale or its axes",
                "beacons that were all moved together",
            ),
            signals=tuple(f"tracker_pose/{name}" for name in TRACKED),
            label="distance between the two poses",
            unit="m",
            limit=APART,
            time=starts,
            values=away,
        )


def _residuals(found: Sightings) -> tuple[Array, Array]:
    """Return the turns (N, K, 3) from expected to seen, and their angles (N, K) in deg."""
    across = np.cross(found.expected, found.seen)
    along = (found.expected * found.seen).sum(axis=2)
    return across, np.degrees(np.arctan2(np.linalg.norm(across, axis=2), along))


def _scatter(angle: Array) -> float:
    """Return the rms of angles (deg) for each of their two directions."""
    return float(np.sqrt(np.nanmean(angle**2) / 2.0))


def _compared(
    topics: Topics, parameters: Parameters, spans: Spans, topic: str = "tracker_pose"
) -> Sightings | None:
    """Return the bearings and those expected from the poses of a topic; None if that is unknown."""
    place_of, attitude_of = PLACES[topic]
    if not has(topics, topic, *place_of, *attitude_of) or "bearings" not in topics:
        return None
    if any(parameters.get(name, 0.0) != 0.0 for name in MOUNT):
        return None
    try:
        beacons = parse_layout(str(parameters.get("beacons.layout", "")))
    except MeasurementError:
        return None
    poses, frames = topics[topic], topics["bearings"]
    place = {int(id): k for k, id in enumerate(beacons.ids.tolist())}
    near = np.searchsorted(poses.time, frames.time).clip(max=len(poses) - 1)
    use = within(frames.time, spans) & (np.abs(poses.time[near] - frames.time) < OLDEST)
    if use.sum() < FEWEST:
        return None
    near = near[use]
    R_wb = matrices_of(poses.rows(attitude_of)[near].astype(np.float64))
    away = beacons.positions_w[None] - poses.rows(place_of)[near].astype(np.float64)[:, None]
    expected = np.einsum("nji,nkj->nki", R_wb, away)
    expected /= np.linalg.norm(expected, axis=2, keepdims=True)
    seen = np.full_like(expected, np.nan)
    for row in range(len(place)):
        names = tuple(f"bearings[{row}].{axis}" for axis in "xyz")
        if not has(topics, "bearings", f"beacon_ids[{row}]", *names):
            break
        ids = frames.values(f"beacon_ids[{row}]")[use]
        for id, k in place.items():
            where = ids == id
            seen[where, k] = frames.rows(names)[use][where]
    if np.isnan(seen).all(axis=(0, 2)).any():
        return None
    sigma = float(np.degrees(np.nanmedian(frames.values("sigma")[use])))
    return Sightings(frames.time[use], list(place), seen, expected, sigma)


def _swapped(found: Sightings, angle: Array) -> tuple[int, int] | None:
    """Return two beacons that are seen in each other's direction, by their places in the layout."""
    count = len(found.ids)
    for one in range(count):
        for other in range(one + 1, count):
            crossed = (found.seen[:, one] * found.expected[:, other]).sum(axis=1)
            back = (found.seen[:, other] * found.expected[:, one]).sum(axis=1)
            swapped = (
                (angle[:, one] > SWAPPED)
                & (angle[:, other] > SWAPPED)
                & (crossed > np.cos(np.radians(angle[:, one])))
                & (back > np.cos(np.radians(angle[:, other])))
            )
            if swapped.mean() > 0.1:
                return one, other
    return None


def _lens(found: Sightings) -> tuple[float, float]:
    """Return the cubic distortion (1/rad²) and the share of the mean offsets that it explains."""
    ahead = np.sign(np.nanmean(found.expected[..., 2])) or 1.0  # the sensor looks up or down
    cosines = (ahead * one[..., 2] for one in (found.expected, found.seen))
    from_axis = [np.arccos(np.clip(one, -1.0, 1.0)) for one in cosines]
    grown = np.nanmean(from_axis[1] - from_axis[0], axis=0)
    cube = np.nanmean(from_axis[0] ** 3, axis=0)
    distortion = float((grown * cube).sum() / max((cube**2).sum(), 1e-9))
    across = np.linalg.norm(np.nanmean(np.cross(found.expected, found.seen), axis=0), axis=1)
    left = np.abs(grown - distortion * cube)
    total = float((across**2).sum())
    explained = 1.0 - float((left**2 + np.maximum(across**2 - grown**2, 0.0)).sum()) / total
    return distortion, explained if total > 0.0 else 0.0


def _finding(kind: str, weight: float, claim: str, time: Array, values: Array) -> Finding:
    return Finding(
        kind=kind,
        weight=weight,
        start=float(time[0]),
        end=float(time[-1]),
        claim=claim,
        signals=("bearings/sigma",),
        label="angle between bearing and expected direction",
        unit="°",
        limit=OFF,
        time=time,
        values=values,
    )
