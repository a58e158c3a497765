"""The part of a flight over which a replay is judged."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from quadlab.recording.errors import Truth
from quadlab.recording.log import Arrival, Recording
from quadrotor.errors import UsageError
from quadrotor.records import has_attitude

HEIGHT = 0.05
"""m above the lowest point at which a vehicle counts as airborne if the log has no status of it."""


@dataclass(frozen=True)
class Window:
    """A window from start to end, inclusive, ns; and how it was found."""

    start_ns: int
    end_ns: int
    found: str


def find_window(
    recording: Recording, truth: Truth, start: float | None, end: float | None
) -> Window:
    """Return the window of --from and --to (s), else the airborne part of the flight.

    Raises UsageError when there is nothing to compare in it.
    """
    first, last = recording.start_ns, int(recording.imu["stamp_ns"][-1])
    airborne_start, airborne_end, found = _airborne(recording, truth)
    if start is None and end is None:
        start_ns, end_ns = airborne_start, airborne_end
    else:
        for word, value in (("--from", start), ("--to", end)):
            if value is not None and not math.isfinite(value):
                raise UsageError(f"{word} {value}: a finite time in s is needed")
        start_ns = first + round(1e9 * start) if start is not None else first
        end_ns = first + round(1e9 * end) if end is not None else last
        found = "as given"
    covered = recording.imu["stamp_ns"][truth.covers(recording.imu["stamp_ns"])]
    inside = (covered >= start_ns) & (covered <= end_ns)
    if not inside.any():
        span = "nowhere"
        if len(covered):
            low, high = recording.seconds(covered[0]), recording.seconds(covered[-1])
            span = f"from {low:.2f} s to {high:.2f} s"
        asked = f"--from {start or 0.0:g}" + ("" if end is None else f" --to {end:g}")
        raise UsageError(
            f"nothing to compare with {asked if found == 'as given' else 'airborne'}: there are "
            f"samples and truth {span} after the first sample, and the vehicle was airborne from "
            f"{recording.seconds(airborne_start):.2f} s to {recording.seconds(airborne_end):.2f} s"
        )
    return Window(max(start_ns, int(covered[0])), min(end_ns, int(covered[-1])), found)


def _airborne(recording: Recording, truth: Truth) -> tuple[int, int, str]:
    stamps = [stamp_ns for stamp_ns, flying in recording.airborne if flying]
    if stamps:
        return stamps[0], stamps[-1], "airborne by the vehicle's status"
    height = truth.position_w[:, 2]
    above = truth.stamps_ns[height > height.min() + HEIGHT]
    if len(above):
        return int(above[0]), int(above[-1]), f"more than {HEIGHT:g} m above the lowest point"
    return int(truth.stamps_ns[0]), int(truth.stamps_ns[-1]), "all of it: it was never airborne"


def with_attitude(recording: Recording) -> list[Arrival]:
    """Return the tracker's recorded poses, without those that are only positions of a marker."""
    return [one for one in recording.poses if has_attitude(one.measurement["quaternion_wb"])]


def tracked_truth(recording: Recording) -> Truth:
    """Return the tracker's recorded poses as the truth; velocities are unknown."""
    ordered = {int(pose["stamp_ns"][0]): pose[0] for _, pose in with_attitude(recording)}
    states = np.zeros(len(ordered), recording.truth.dtype)
    stamps = np.array(sorted(ordered), np.int64)
    for k, stamp_ns in enumerate(stamps.tolist()):
        states["position_w"][k] = ordered[stamp_ns]["position_w"]
        states["quaternion_wb"][k] = ordered[stamp_ns]["quaternion_wb"]
    states["velocity_w"] = math.nan
    return Truth(stamps, states)
