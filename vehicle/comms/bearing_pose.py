"""One-frame poses from bearings to known beacons (Sec. 6.2), as the vehicle publishes them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bearing_sim.beacons import PAPER_BEACONS, Beacons
from estimation.poses.planar_pose import PlanarPoseSolver
from quadrotor.errors import MeasurementError
from quadrotor.records import Record
from vehicle_link import topics


class BearingPose:
    """Knows where the beacons are.

    Args:
        beacons: ids and positions; default the paper's four.
    """

    def __init__(self, beacons: Beacons = PAPER_BEACONS) -> None:
        self.place(beacons)
        # Made here, which compiles: at the first frame in flight all that follow would be late.
        self._solver = PlanarPoseSolver(PAPER_BEACONS.positions_w)

    def place(self, beacons: Beacons) -> None:
        """Place the beacons elsewhere from the next frame on."""
        self._places = dict(zip(beacons.ids.tolist(), beacons.positions_w, strict=True))
        self._ids: list[int] | None = None
        self._known: list[int] = []

    def solve(
        self,
        stamp_ns: int,
        beacon_ids: Sequence[int],
        bearings_b: npt.ArrayLike,
        sigma: float,
        state: Record | None,
    ) -> bytes:
        """Return the encoded `bearing_pose` of one frame.

        Args:
            bearings_b: (N, 3) unit vectors in body axes. sigma: rad on each tangent axis.
            state: STATE of shape (1,) to start the search from, which is what makes poses near
                the beacons' own plane possible; None when there is none.

        Raises MeasurementError; DegenerateGeometryError when too few beacons are seen, one comes
        twice, or they do not determine a pose.
        """
        bearings = np.asarray(bearings_b, dtype=float)
        ids = list(beacon_ids)
        if ids != self._ids:  # mostly the same beacons are seen from frame to frame
            self._look_for(ids)
        if bearings.shape != (len(ids), 3):
            raise MeasurementError(
                f"bearings of shape {bearings.shape} for {len(ids)} ids; ({len(ids)}, 3) is needed"
            )
        if len(self._known) < len(ids):
            bearings = bearings[self._known]
        start = None
        if state is not None:
            start = (state["position_w"][0], state["quaternion_wb"][0])
        pose = self._solver.solve(bearings, sigma, start)
        return topics.encode_bearing_pose(
            stamp_ns, pose.position_w, pose.quaternion_wb, pose.covariance
        )

    def _look_for(self, ids: list[int]) -> None:
        """Prepare for frames of these ids. Raises MeasurementError, and then stays as it was."""
        known = [k for k, one in enumerate(ids) if one in self._places]
        if not known:
            raise MeasurementError(f"no known beacon among {ids}; known are {sorted(self._places)}")
        seen = [ids[k] for k in known]
        self._solver = PlanarPoseSolver([self._places[one] for one in seen], seen)
        self._ids, self._known = ids, known
