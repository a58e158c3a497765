"""The inspection of a frame of bearings before the estimator in use gets it."""

from __future__ import annotations

from bearing_sim.beacon_set import with_rows
from estimation.estimator import fewest_beacons
from quadrotor.records import Record, beacon_ids_of
from vehicle.estimators.bearings_watch import BearingsWatch
from vehicle.estimators.choice import Seats
from vehicle.estimators.suspect_beacon import SuspectBeacon


def inspected(
    frame: Record, seats: Seats, watch: BearingsWatch, suspect: SuspectBeacon, now_ns: int
) -> Record | None:
    """Return a BEARINGS_SAMPLE (1,) without the bearings that may not be used; None when nothing
    of it may. `watch` judges it and `suspect` reports.
    """
    estimator = seats.active.estimator
    deviations = estimator.deviations
    rows = watch.frame(frame, deviations, now_ns)
    count = int(frame["count"][0])
    if deviations is not None:
        rows = list(range(count))  # a filter with a covariance has a gate of its own
    ids = beacon_ids_of(frame)
    watch.average(frame, ids, seats.reserve_ready)
    off, wanted, hindrance = watch.offsets.suspect, watch.parameters.exclude_beacon, ""
    if off is not None and off.beacon is not None and wanted:
        left = [row for row in rows if ids[row] != off.beacon]
        fewest = fewest_beacons(estimator)
        if len(left) < fewest:
            hindrance = f"{len(left)} would be left, the estimator needs {fewest}"
        else:
            rows = left
    suspect.look(off, wanted and not hindrance, hindrance)
    if len(rows) == count:
        return frame
    return with_rows(frame, rows) if rows else None
