"""The inspection of measurements before an estimator in use that flies on bearings gets them."""

from __future__ import annotations

from bearing_sim.beacon_set import with_rows
from estimation.convergence import difference
from estimation.estimator import fewest_beacons
from quadrotor.records import POSE_SAMPLE, Record, beacon_ids_of
from vehicle.estimators.bearings_watch import BearingsWatch
from vehicle.estimators.choice import EstimatorSet
from vehicle.estimators.estimator_runner import BEARINGS
from vehicle.estimators.suspect_beacon import SuspectBeacon


def inspected(
    measurement: Record,
    running: EstimatorSet,
    watch: BearingsWatch,
    suspect: SuspectBeacon,
    state: Record,
    now_ns: int,
) -> Record | None:
    """Return the measurement for an estimator that uses bearings, None when it may not be used.

    `watch` judges it by the STATE (1,) in use, and `suspect` reports.
    """
    active, reserve = running.active, running.reserve
    if active.source == BEARINGS:
        watch.age(active.estimator.measurement_age)
    if measurement.dtype != POSE_SAMPLE:
        return _inspected_frame(measurement, running, watch, suspect, now_ns)
    if reserve is not None and running.reserve_ready:
        watch.pose(difference(reserve.state, state))
    return measurement


def _inspected_frame(
    frame: Record, running: EstimatorSet, watch: BearingsWatch, suspect: SuspectBeacon, now_ns: int
) -> Record | None:
    """Return a BEARINGS_SAMPLE (1,) without the bearings that may not be used; None if none may."""
    estimator = running.active.estimator
    deviations = estimator.deviations
    rows = watch.frame(frame, deviations, now_ns)
    count = int(frame["count"][0])
    if deviations is not None:
        rows = list(range(count))  # a filter with a covariance has a gate of its own
    ids = beacon_ids_of(frame)
    watch.average(frame, ids, running.reserve_ready)
    off, wanted, hindrance = watch.offsets.suspect, watch.parameters.exclude_beacon, ""
    if off is not None and off.beacon is not None and wanted:
        left = [row for row in rows if ids[row] != off.beacon]
        fewest = fewest_beacons(estimator)
        if len(left) < fewest:
            hindrance = f"{len(left)} would be left, the estimator needs {fewest}"
        else:
            rows = left
    suspect.check(off, wanted and not hindrance, hindrance)
    if len(rows) == count:
        return frame
    return with_rows(frame, rows) if rows else None
