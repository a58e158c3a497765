"""One-frame poses from bearings to known beacons (Sec. 6.2), as the vehicle publishes them."""

from __future__ import annotations

from bearing_sim.beacon_set import KnownBeacons
from estimation.poses.beacon_plane import require_distinct
from estimation.poses.planar_pose import planar_pose
from quadrotor.errors import MeasurementError
from quadrotor.records import Record, beacon_ids_of
from vehicle_link.topics.measurements import encode_bearing_pose


def bearing_pose(seen: Record, beacons: KnownBeacons, state: Record | None) -> bytes:
    """Return the encoded `bearing_pose` of one frame.

    Args:
        seen: BEARINGS_SAMPLE (1,); places are read from `beacons`.
        state: STATE of shape (1,) from which the search starts, which makes poses near the beacons'
            own plane possible; None when there is none.

    Raises MeasurementError; DegenerateGeometryError when too few beacons are seen, one appears
    twice, or they do not determine a pose.
    """
    frame = beacons.with_positions(seen)
    item = frame[0]
    count = int(item["count"])
    if not count:
        ids = beacon_ids_of(seen)
        raise MeasurementError(f"no known beacon among {ids}; known are {beacons.ids}")
    require_distinct(beacon_ids_of(frame))
    start = None
    if state is not None:
        start = (state["position_w"][0], state["quaternion_wb"][0])
    pose = planar_pose(
        item["beacon_w"][:count], item["bearing_b"][:count], float(item["sigma"]), start
    )
    return encode_bearing_pose(
        int(item["stamp_ns"]), pose.position_w, pose.quaternion_wb, pose.covariance
    )
