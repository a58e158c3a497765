"""The touch-down, or the hover, of a laboratory by its logs."""

from __future__ import annotations

import math
from itertools import islice
from pathlib import Path

from benchmarks.flights.touch_down import Outcome, TouchDown
from flight_log.reader import read_log
from vehicle_link.topics.ticks import decode_odometry

AIRBORNE = 0.1
"""Height, in m, above which the vehicle has taken off."""
MOVED = 0.1
"""Largest way, in m, from the place of the hover."""
EVERY = 10
"""Number of states of the truth from one that is judged to the next."""


def logs(folder: Path) -> list[Path]:
    """Return the logs of the station and of the vehicle."""
    return [*folder.glob("runs/*/station.mcap"), *folder.glob("onboard/*.mcap")]


def touch_down(path: Path, name: str) -> float:
    """Return the vertical speed of the touch-down in a log, m/s; NaN if there is none.

    Raises LogFormatError.
    """
    outcome = Outcome("", "", 0)
    observer: TouchDown | None = None
    for message in read_log(path, {f"/quad1/{name}"}):
        stamp_ns, state = decode_odometry(message.payload)
        position = [float(x) for x in state["position_w"][0]]
        if observer is None and position[2] > AIRBORNE:
            observer = TouchDown(outcome, 1e-9 * stamp_ns, position)
        if observer is not None:
            climb = float(state["velocity_w"][0, 2])
            observer.note(1e-9 * stamp_ns, position, climb, state["quaternion_wb"][0])
    return outcome.impact


def moved(data: Path, after_ns: int) -> float:
    """Return the largest distance from where the vehicle was, m, by the truth of its run."""
    most = 0.0
    first: list[float] | None = None
    for path in (data / "runs").glob("*/station.mcap"):
        for message in islice(read_log(path, {"/quad1/truth"}), 0, None, EVERY):
            stamp_ns, state = decode_odometry(message.payload)
            if stamp_ns > after_ns and state["position_w"][0, 2] > MOVED:
                place = [float(x) for x in state["position_w"][0]]
                first = place if first is None else first
                most = max(most, math.dist(place, first))
    return most


def newest_truth(data: Path) -> int:
    """Return the stamp of the newest truth in the runs, ns."""
    stamps = [
        message.publish_ns
        for path in (data / "runs").glob("*/station.mcap")
        for message in read_log(path, {"/quad1/truth"})
    ]
    return max(stamps, default=0)
