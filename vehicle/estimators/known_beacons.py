"""The beacons' positions, by id, as the vehicle knows it."""

from __future__ import annotations

import numpy as np

from bearing_sim.beacons import Beacons
from quadrotor.records import BEARINGS_SAMPLE, MAX_BEACONS, Record
from vehicle.processes import mailbox


class KnownBeacons:
    """Makes the record that estimators take out of a message of ids and bearings."""

    def __init__(self, beacons: Beacons) -> None:
        self._places = dict(zip(beacons.ids.tolist(), beacons.positions_w.tolist(), strict=True))
        self._ids = {tuple(place): one for one, place in self._places.items()}

    @property
    def ids(self) -> list[int]:
        return sorted(self._places)

    def ids_of(self, frame: Record) -> list[int]:
        """Return the ids in a BEARINGS_SAMPLE (1,) that `frame` made, in its order."""
        count = int(frame["count"][0])
        return [self._ids[tuple(place)] for place in frame["beacon_w"][0, :count].tolist()]

    def frame(self, measurement: mailbox.Bearings) -> Record | None:
        """Return BEARINGS_SAMPLE (1,) of those that are known; None when none is."""
        places = self._places
        seen = [
            (places[one], bearing)
            for one, bearing in zip(measurement.beacon_ids, measurement.bearings_b, strict=False)
            if one in places
        ][:MAX_BEACONS]
        if not seen:
            return None
        frame = np.zeros(1, BEARINGS_SAMPLE)
        item = frame[0]
        item["stamp_ns"], item["count"], item["sigma"] = (
            measurement.stamp_ns,
            len(seen),
            measurement.sigma,
        )
        item["beacon_w"][: len(seen)] = [place for place, _ in seen]
        item["bearing_b"][: len(seen)] = [bearing for _, bearing in seen]
        return frame
