"""Measurements for the vehicle (tracker poses, positions of a marker, bearings, sweeps), readings
of the user's own sensors, and pictures.

Stamps are already on the vehicle's clock. Decoders accept the messages of any ROS node and refuse
numbers that the estimator could not use.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

from quadrotor.errors import MeasurementError
from quadrotor.records import (
    MAX_SENSORS,
    NO_ATTITUDE,
    POSE_SAMPLE,
    SWEEPS_SAMPLE,
    Array,
    Record,
    bearings_sample,
    pose_sample,
)
from vehicle_link.messages import decode, encode, header, new, stamp_of
from vehicle_link.messages.cdr_layout import FixedLayout, Records
from vehicle_link.topics.ticks import (
    FROM_ROS,
    TO_ROS,
    VEHICLE,
    WORLD,
    body_frame,
    layout,
    set_stamps,
    stamp_of_record,
    xyz,
)

CALIBRATION = ("tilt", "phase", "gib_magnitude", "gib_phase", "curve")  # of a SWEEP_PLANE


def pose_messages(samples: Record) -> Records:
    """Encode `tracker_pose`: geometry_msgs/PoseStamped of POSE_SAMPLE records, shape (N,)."""
    poses = layout("geometry_msgs/PoseStamped", WORLD)
    out = poses.new(len(samples))
    set_stamps(out, samples["stamp_ns"])
    out["pose.position"] = samples["position_w"]
    out["pose.orientation"] = samples["quaternion_wb"][:, TO_ROS]
    return out


def decode_pose(payload: bytes, *, or_position: bool = False) -> Record:
    """Decode POSE_SAMPLE of shape (1,), with the quaternion normalised.

    Args:
        or_position: whether the quaternion may be NO_ATTITUDE.

    Raises:
        LinkError: the bytes are not a PoseStamped.
        MeasurementError: a number is not finite or the quaternion is far from unit length.
    """
    sample = np.zeros(1, POSE_SAMPLE)
    poses = layout("geometry_msgs/PoseStamped", WORLD)
    if poses.fits(payload):
        record = poses.decode(payload)
        sample["stamp_ns"] = stamp_of_record(record)
        sample["position_w"] = record["pose.position"]
        sample["quaternion_wb"] = record["pose.orientation"][FROM_ROS]
    else:
        message = decode(payload, "geometry_msgs/PoseStamped")
        pose = message.pose
        sample["stamp_ns"] = stamp_of(message)
        sample["position_w"] = xyz(pose.position)
        sample["quaternion_wb"] = (pose.orientation.w, *xyz(pose.orientation))
    position, quaternion = sample["position_w"][0].tolist(), sample["quaternion_wb"][0].tolist()
    length = math.hypot(*quaternion)
    is_position = or_position and length == 0.0
    if not all(map(math.isfinite, position)) or not (is_position or abs(length - 1.0) < 0.1):
        raise MeasurementError(
            f"pose with position {position} and quaternion (w, x, y, z) {quaternion}: "
            "finite numbers and a unit quaternion are needed"
        )
    sample["quaternion_wb"] /= length or 1.0
    return sample


def position_messages(samples: Record) -> Records:
    """Encode `tracker_position`: geometry_msgs/PointStamped of POSE_SAMPLE records without
    attitude, shape (N,).
    """
    out = layout("geometry_msgs/PointStamped", WORLD).new(len(samples))
    set_stamps(out, samples["stamp_ns"])
    out["point"] = samples["position_w"]
    return out


def decode_position(payload: bytes) -> Record:
    """Decode a POSE_SAMPLE of shape (1,) without attitude from a `tracker_position`.

    Raises LinkError; MeasurementError when a number is not finite.
    """
    message = decode(payload, "geometry_msgs/PointStamped")
    position = xyz(message.point)
    if not all(map(math.isfinite, position)):
        raise MeasurementError(f"marker at {position}: finite numbers are needed")
    return pose_sample(stamp_of(message), position, NO_ATTITUDE)


def encode_bearing_pose(
    stamp_ns: int, position_w: Array, quaternion_wb: Array, covariance: Array
) -> bytes:
    """Encode `bearing_pose`: PoseWithCovarianceStamped; covariance (6, 6), m² then rad² (ROS
    order).
    """
    poses = layout("geometry_msgs/PoseWithCovarianceStamped", WORLD)
    out = poses.new()
    set_stamps(out, stamp_ns)
    out["pose.pose.position"] = position_w
    out["pose.pose.orientation"] = np.asarray(quaternion_wb)[TO_ROS]
    out["pose.covariance"] = np.asarray(covariance).reshape(36)
    return out.tobytes()


@cache
def _bearings_layout(ids: int, bearings: int, vehicle: str) -> FixedLayout:
    strings = {"header.frame_id": body_frame(vehicle)}
    lengths = {"beacon_ids": ids, "bearings": bearings}
    return FixedLayout("quadlab_msgs/BearingArray", strings, lengths)


def encode_bearings(
    stamp_ns: int,
    beacon_ids: Sequence[int] | npt.NDArray[np.int32],
    bearings_b: Sequence[Sequence[float]] | Array,
    sigma: float,
    vehicle: str = VEHICLE,
) -> bytes:
    """Encode `bearings`: quadlab_msgs/BearingArray of N unit vectors in body axes, shape (N, 3)."""
    out = _bearings_layout(len(beacon_ids), len(bearings_b), vehicle).new()
    set_stamps(out, stamp_ns)
    if len(beacon_ids):
        out["beacon_ids"] = beacon_ids
    if len(bearings_b):
        out["bearings"] = bearings_b
    out["sigma"] = sigma
    return out.tobytes()


def decode_bearings(payload: bytes) -> Record:
    """Decode BEARINGS_SAMPLE of shape (1,), without the beacons' positions.

    Raises LinkError; MeasurementError when the numbers are not usable as bearings.
    """
    message = decode(payload, "quadlab_msgs/BearingArray")
    ids = tuple(int(one) for one in message.beacon_ids)
    bearings = tuple(xyz(one) for one in message.bearings)
    if len(ids) != len(bearings):
        raise MeasurementError(f"{len(bearings)} bearings with {len(ids)} beacon ids")
    if not all(abs(math.hypot(*one) - 1.0) < 1e-3 for one in bearings):
        raise MeasurementError(f"bearings must be finite unit vectors, not {bearings}")
    if not (math.isfinite(message.sigma) and message.sigma > 0.0):
        raise MeasurementError(f"sigma of the bearings must be above 0 rad, not {message.sigma}")
    return bearings_sample(stamp_of(message), ids, bearings, float(message.sigma))


@cache
def _sweeps_layout(count: int, vehicle: str) -> FixedLayout:
    strings = {"header.frame_id": body_frame(vehicle)}
    lengths = {"sensors": count, "angles": count}
    return FixedLayout("quadlab_msgs/SweepArray", strings, lengths)


def sweep_messages(samples: Record, vehicle: str = VEHICLE) -> Records:
    """Encode `sweeps`: quadlab_msgs/SweepArray of SWEEPS_SAMPLE records, shape (N,), all with the
    same number of sensors.
    """
    count, plane = int(samples["count"][0]), samples["plane"]
    out = _sweeps_layout(count, vehicle).new(len(samples))
    set_stamps(out, samples["stamp_ns"])
    out["plane"], out["sigma"] = samples["number"], samples["sigma"]
    out["rotor.position"] = plane["origin_w"]
    out["rotor.orientation"] = plane["quaternion_wr"][:, TO_ROS]
    for name in CALIBRATION:
        out[name] = plane[name]
    out["sensors"] = samples["sensor_b"][:, :count]
    out["angles"] = samples["angle"][:, :count]
    return out


def decode_sweeps(payload: bytes) -> Record:
    """Decode SWEEPS_SAMPLE of shape (1,). Raises LinkError; MeasurementError when there are more
    sensors than a record holds, or another number of sensors than of angles.
    """
    message = decode(payload, "quadlab_msgs/SweepArray")
    sample, count = np.zeros(1, SWEEPS_SAMPLE), len(message.angles)
    if not count == len(message.sensors) <= MAX_SENSORS:
        raise MeasurementError(
            f"{count} sweep angles with {len(message.sensors)} sensors, allowed {MAX_SENSORS}"
        )
    turn, plane = message.rotor.orientation, sample["plane"]
    sample["stamp_ns"], sample["number"] = stamp_of(message), message.plane
    sample["count"], sample["sigma"] = count, message.sigma
    plane["origin_w"] = xyz(message.rotor.position)
    plane["quaternion_wr"] = turn.w, *xyz(turn)
    for name in CALIBRATION:
        plane[name] = getattr(message, name)
    sample["angle"][0, :count] = message.angles
    for k, place in enumerate(message.sensors):
        sample["sensor_b"][0, k] = xyz(place)
    return sample


@cache
def _reading_layout(sensor: str) -> FixedLayout:
    return FixedLayout("quadlab_msgs/SensorReading", {"sensor": sensor})


def encode_reading(judged: Record) -> tuple[str, bytes]:
    """Encode a JUDGED_READING (1,): return its topic, `sensor_1` to `sensor_4`, and its
    quadlab_msgs/SensorReading.
    """
    one = judged[0]
    out = _reading_layout(one["sensor"].decode(errors="replace")).new()
    set_stamps(out, judged["stamp_ns"])
    for name in ("reading", "residual", "gate", "deviation", "judgement"):
        out[name] = one[name]
    out["expected"] = one["reading"] - one["residual"]
    return f"sensor_{one['place']}", out.tobytes()


PICTURE: Final = "sensor_msgs/CompressedImage"
JPEG = b"\xff\xd8"
"""First bytes of every JPEG."""


def encode_picture(stamp_ns: int, jpeg: bytes, frame_id: str) -> bytes:
    """Encode a JPEG; `stamp_ns` is when it was taken."""
    data = np.frombuffer(jpeg, np.uint8)
    return encode(new(PICTURE, header=header(stamp_ns, frame_id), format="jpeg", data=data))


def decode_picture(payload: bytes) -> bytes:
    """Return the JPEG. Raises LinkError; MeasurementError if another node sent no JPEG."""
    jpeg = decode(payload, PICTURE).data.tobytes()
    if not jpeg.startswith(JPEG):
        raise MeasurementError(f"a picture of {len(jpeg)} bytes that is not a JPEG; send JPEG")
    return bytes(jpeg)
