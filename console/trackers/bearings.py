"""The process of a system that measures bearings to beacons from a vehicle.

The station converts them to the vehicle's clock and sends them instead of the emulated ones.
"""

from __future__ import annotations

import numpy as np

from console.trackers.process import Tracker, to_epoch
from console.trackers.source import Frame
from console.trackers.tracked_vehicle import TopicNames, TrackedVehicle
from vehicle_link.topics.measurements import encode_bearings


class BearingsTracker(Tracker):
    """Publishes the bearings of a camera on one vehicle, and its status."""

    topics = TopicNames("camera_bearings", "camera_status", ("camera_picture",))
    markers = "beacons"
    unseen_for = 1.0

    def _handle_frame(self, frame: Frame, taken_ns: int | None, now: float) -> None:
        [one], seen = self._vehicles, frame.beacons
        if seen is None or not seen.beacon_ids:
            return
        self._seen.extend((now, f"beacon {number}") for number in seen.beacon_ids)
        one.gaps += one.is_missing
        one.seen, one.is_missing = now, False
        if taken_ns is not None:
            stamp_ns, ids = to_epoch(taken_ns), np.array(seen.beacon_ids, np.int32)
            payload = encode_bearings(stamp_ns, ids, seen.bearings_b, seen.sigma, one.vehicle)
            one.measurements.put(payload, stamp_ns)

    def _unseen(self, one: TrackedVehicle) -> str:
        return f"{self._name} sees no beacon; check the light and where the beacons are"
