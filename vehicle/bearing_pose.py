"""One-frame poses from bearings to known beacons (Sec. 6.2), as the vehicle publishes them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bearing_sim.beacons import PAPER_BEACONS, Beacons
from estimation.planar_pose import planar_pose
from quadrotor.errors import MeasurementError
from quadrotor.records import Record
from vehicle_link import topics


class BearingPose:
    """Knows where the beacons are.

    Args:
        beacons: ids and positions; default the paper's four.
    """

    def __init__(self, beacons: Beacons = PAPER_BEACONS) -> None:
        self._places = dict(zip(beacons.ids.tolist(), beacons.positions_w, strict=True))
        self._ids: list[int] | None = None
        self._known: list[int] = []
        self._beacons_w = np.empty((0, 3))
        # Compiled here: at the first frame in flight all that follow would be a second late.
        above = PAPER_BEACONS.positions_w - np.array([0.1, 0.2, 1.5])
        above /= np.linalg.norm(above, axis=1)[:, None]
        level = np.array([0.1, 0.2, 1.5]), np.array([1.0, 0.0, 0.0, 0.0])
        for start in (None, level):
            planar_pose(PAPER_BEACONS.positions_w, above, 0.01, start)

    def solve(
        self,
        stamp_ns: int,
        beacon_ids: Sequence[int],
        bearings_b: npt.ArrayLike,
        sigma: float,
        state: Record | None,
    ) -> bytes:
        """The encoded `bearing_pose` of one frame.

        Args:
            bearings_b: (N, 3) unit vectors in body axes. sigma: rad on each tangent axis.
            state: STATE of shape (1,) to start the search from, which is what makes poses near
                the beacons' own plane possible; None when there is none.

        Raises MeasurementError.
        """
        bearings = np.asarray(bearings_b, dtype=float)
        ids = list(beacon_ids)
        if ids != self._ids:  # mostly the same beacons are seen from frame to frame
            self._ids = ids
            self._known = [k for k, one in enumerate(ids) if one in self._places]
            places = [self._places[ids[k]] for k in self._known]
            self._beacons_w = np.array(places, dtype=float).reshape(-1, 3)
        known = self._known
        if not known:
            raise MeasurementError(f"no known beacon among {ids}; known are {sorted(self._places)}")
        if len(known) < len(ids):
            bearings = bearings[known]
        start = None
        if state is not None:
            start = (state["position_w"][0], state["quaternion_wb"][0])
        pose = planar_pose(self._beacons_w, bearings, sigma, start)
        return topics.encode_bearing_pose(
            stamp_ns, pose.position_w, pose.quaternion_wb, pose.covariance
        )
