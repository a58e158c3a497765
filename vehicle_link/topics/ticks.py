"""Ticks to the standard topics and back: state, reference, imu, actuators, and the truth.

All encoders take TICK (or STATE) records of shape (N,) and return N payloads; the `..._messages`
below them return the same bytes as one array of N records, for writing many at once. A twist is
in body axes, as nav_msgs/Odometry requires; `decode_odometry` converts it back to world axes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from quadrotor.plain_rotations import rotate
from quadrotor.records import IMU_SAMPLE, STATE, Array, Record
from vehicle_link.messages import decode, stamp_of
from vehicle_link.messages.cdr_layout import FixedLayout, Records

WORLD = "world"
SECOND_NS = 1_000_000_000
VEHICLE = "quad1"


FEW = 16
"""Number of vectors up to which plain numbers are rotated faster than arrays."""

# ROS orders quaternions (x, y, z, w), we (w, x, y, z).
TO_ROS, FROM_ROS = [1, 2, 3, 0], [3, 0, 1, 2]


@cache
def layout(type_name: str, frame: str, child_frame: str = "") -> FixedLayout:
    """Return the layout of a stamped message in this frame."""
    strings = {"header.frame_id": frame}
    if child_frame:
        strings["child_frame_id"] = child_frame
    return FixedLayout(type_name, strings)


def body_frame(vehicle: str) -> str:
    return f"{vehicle}/body"


def odometry_messages(stamps_ns: object, states: Record, vehicle: str = VEHICLE) -> Records:
    """Encode nav_msgs/Odometry of STATE records with their stamps, shape (N,)."""
    odometry = layout("nav_msgs/Odometry", WORLD, body_frame(vehicle))
    out = odometry.new(len(states))
    set_stamps(out, stamps_ns)
    quaternion = states["quaternion_wb"]
    out["pose.pose.position"] = states["position_w"]
    out["pose.pose.orientation"] = quaternion[:, TO_ROS]
    out["twist.twist.linear"] = _rotate(quaternion, states["velocity_w"], inverse=True)
    out["twist.twist.angular"] = states["angular_velocity_b"]
    return out


def state_messages(ticks: Record, vehicle: str = VEHICLE) -> Records:
    """Encode `state`: nav_msgs/Odometry of the estimate; shape (N,)."""
    return odometry_messages(ticks["imu"]["stamp_ns"], ticks["state"], vehicle)


def decode_odometry(payload: bytes, vehicle: str = VEHICLE) -> tuple[int, Record]:
    """Decode (stamp in ns, STATE record of shape (1,)). Raises LinkError."""
    state = np.zeros(1, STATE)
    odometry = layout("nav_msgs/Odometry", WORLD, body_frame(vehicle))
    if odometry.fits(payload):
        record = odometry.decode(payload)
        stamp = stamp_of_record(record)
        state["position_w"] = record["pose.pose.position"]
        state["quaternion_wb"] = record["pose.pose.orientation"][FROM_ROS]
        velocity_b, omega_b = record["twist.twist.linear"], record["twist.twist.angular"]
    else:  # other frames: of another node
        message = decode(payload, "nav_msgs/Odometry")
        stamp, pose, twist = stamp_of(message), message.pose.pose, message.twist.twist
        state["position_w"] = xyz(pose.position)
        state["quaternion_wb"] = (pose.orientation.w, *xyz(pose.orientation))
        velocity_b, omega_b = np.array(xyz(twist.linear)), xyz(twist.angular)
    state["angular_velocity_b"] = omega_b
    state["velocity_w"] = _rotate(state["quaternion_wb"], velocity_b[None, :], inverse=False)
    return stamp, state


def decode_odometry_pose(payload: bytes, vehicle: str = VEHICLE) -> tuple[int, Array, Array]:
    """Decode the stamp in ns, position (3,) m and quaternion (4,) (w, x, y, z) alone. Raises
    LinkError.
    """
    odometry = layout("nav_msgs/Odometry", WORLD, body_frame(vehicle))
    if odometry.fits(payload):
        record = odometry.decode(payload)
        quaternion = record["pose.pose.orientation"][FROM_ROS]
        return stamp_of_record(record), record["pose.pose.position"].copy(), quaternion
    stamp_ns, state = decode_odometry(payload, vehicle)
    return stamp_ns, state["position_w"][0], state["quaternion_wb"][0]


def reference_messages(ticks: Record) -> Records:
    """Encode `reference`: quadlab_msgs/Reference; shape (N,)."""
    reference = layout("quadlab_msgs/Reference", WORLD)
    out, source = reference.new(len(ticks)), ticks["reference"]
    set_stamps(out, ticks["imu"]["stamp_ns"])
    for field in ("position", "velocity", "acceleration", "jerk", "snap"):
        out[field] = source[f"{field}_w"]
    for field in ("yaw", "yaw_rate", "yaw_acceleration"):
        out[field] = source[field]
    return out


def imu_messages(ticks: Record, vehicle: str = VEHICLE) -> Records:
    """Encode `imu`: sensor_msgs/Imu (N,), calibrated; its orientation is marked as not given."""
    imu = layout("sensor_msgs/Imu", body_frame(vehicle))
    out, source = imu.new(len(ticks)), ticks["imu"]
    set_stamps(out, source["stamp_ns"])
    out["orientation_covariance"][:, 0] = -1.0  # REP 145: no orientation
    out["angular_velocity"] = source["angular_velocity_b"]
    out["linear_acceleration"] = source["specific_force_b"]
    return out


def decode_imu(payload: bytes, vehicle: str = VEHICLE) -> Record:
    """Decode IMU_SAMPLE record of shape (1,). Raises LinkError."""
    record = layout("sensor_msgs/Imu", body_frame(vehicle)).decode(payload)
    sample = np.zeros(1, IMU_SAMPLE)
    sample["stamp_ns"] = stamp_of_record(record)
    sample["specific_force_b"] = record["linear_acceleration"]
    sample["angular_velocity_b"] = record["angular_velocity"]
    return sample


def actuator_messages(ticks: Record, vehicle: str = VEHICLE) -> Records:
    """Encode `actuators`: quadlab_msgs/Actuators; shape (N,)."""
    actuators = layout("quadlab_msgs/Actuators", body_frame(vehicle))
    out, source = actuators.new(len(ticks)), ticks["actuators"]
    set_stamps(out, ticks["imu"]["stamp_ns"])
    out["thrust"] = source["wrench"][:, 0]
    out["torque"] = source["wrench"][:, 1:]
    for field in ("thrusts", "motor_references", "scaling"):
        out[field] = source[field]
    return out


TICK_TOPICS: dict[str, Callable[..., Records]] = {
    "state": state_messages,
    "reference": lambda ticks, vehicle=VEHICLE: reference_messages(ticks),
    "imu": imu_messages,
    "actuators": actuator_messages,
}
"""Topics that have a message for every tick; each function is called with TICK records (N,) and,
if needed, the vehicle's name.
"""


def set_stamps(out: Records, stamps_ns: Any, within: str = "") -> None:
    """Fill `header.stamp` of N records, or of a message `within` them, from nanoseconds: one int
    for all, or int64 (N,).
    """
    seconds, rest = divmod(stamps_ns, SECOND_NS)
    out[f"{within}header.stamp.sec"] = seconds
    out[f"{within}header.stamp.nanosec"] = rest


def stamp_of_record(record: np.void) -> int:
    return int(record["header.stamp.sec"]) * SECOND_NS + int(record["header.stamp.nanosec"])


def xyz(vector: Any) -> tuple[float, float, float]:
    return (vector.x, vector.y, vector.z)


def _rotate(quaternions: Array, vectors: Array, *, inverse: bool) -> Array:
    """Return r v, or r^T v, of N unit quaternions (w, x, y, z) and N vectors, shape (N, 3)."""
    sign = -1.0 if inverse else 1.0
    if len(vectors) > FEW:
        w, x, y, z = quaternions.T
        return np.column_stack(rotate((w, sign * x, sign * y, sign * z), vectors.T))
    # The same operations on plain numbers: numpy takes 2 µs for each, however few there are.
    pairs = zip(quaternions.tolist(), vectors.tolist(), strict=True)
    turned = [rotate((w, sign * x, sign * y, sign * z), v) for (w, x, y, z), v in pairs]
    return np.array(turned).reshape(-1, 3)
