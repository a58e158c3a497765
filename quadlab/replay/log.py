"""The content of a log for a replay: samples, truth, measurements with their arrivals,
parameters.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flight_log import LogMessage, read_attachments, read_log
from flight_log.attached import json_value, logged_value
from flight_log.records import ReadState
from quadlab.replay.gathered import Columns, Gathered
from quadlab.simulated.flight import FlightParameters
from quadrotor.errors import LinkError, LogFormatError, MeasurementError, ParameterError
from quadrotor.parameters import ParameterStore, ParameterValue
from quadrotor.plain_rotations import rotate
from quadrotor.records import IMU_SAMPLE, STATE, Record
from vehicle_link.messages import decode, stamp_of
from vehicle_link.topics import decode_bearings, decode_odometry, decode_pose
from vehicle_link.topics.ticks import FROM_ROS, SECOND_NS, WORLD, body_frame, layout

Stamps = npt.NDArray[np.int64]

WANTED = (
    "imu",
    "state",
    "truth",
    "tracker_pose",
    "bearings",
    "status",
    "events",
    "parameter_changes",
)
CALIBRATED = "ready: gyroscope bias"
"""The event at whose sample the vehicle's estimators forget what they learnt."""
UNIT = 1e-14
"""A quaternion this near to unit length is taken as it was sent, as simulated flights do."""


class Arrival(NamedTuple):
    """A measurement and when the vehicle had it; it acts at the first sample after that."""

    arrival_ns: int
    measurement: Record
    """POSE_SAMPLE, or BEARINGS_SAMPLE without places, (1,)."""


class Change(NamedTuple):
    """A parameter changed in flight after this sample; those of one revision at once."""

    stamp_ns: int
    revision: int
    name: str
    value: ParameterValue


@dataclass
class Recording:
    """One vehicle's flight; stamps are ns of its clock, times s since its first IMU sample."""

    path: Path
    vehicle: str
    imu: Record  # (N,) IMU_SAMPLE, in order
    state_ns: Stamps  # (M,)
    state: Record  # (M,) STATE: what was flown on
    truth_ns: Stamps
    truth: Record  # STATE
    poses: list[Arrival]
    bearings: list[Arrival]
    parameters: FlightParameters
    changes: list[Change] = field(default_factory=list)
    resets: set[int] = field(default_factory=set)  # stamps of samples
    airborne: list[tuple[int, bool]] = field(default_factory=list)

    @property
    def start_ns(self) -> int:
        return int(self.imu["stamp_ns"][0])

    def seconds(self, stamps_ns: Any) -> Any:
        """Return time of stamps, s."""
        return 1e-9 * (stamps_ns - self.start_ns)


def read_recording(path: Path) -> Recording:
    """Read a log for a replay. Raises StorageError or LogFormatError that say what is missing or
    how to mend it.
    """
    vehicle, found = _messages(path)
    [samples] = found.records("imu")
    samples = _newest(samples["stamp_ns"], samples)
    state_ns, state = found.records("state")
    truth_ns, truth = found.records("truth")
    truth = _newest(truth_ns, truth)
    truth_ns = _newest(truth_ns, truth_ns)
    whole = found.whole
    return Recording(
        path,
        vehicle,
        samples,
        state_ns,
        state,
        truth_ns,
        truth,
        poses=_arrivals(whole["tracker_pose"], _pose),
        bearings=_arrivals(whole["bearings"], decode_bearings),
        parameters=_parameters(path),
        changes=sorted(map(_change, whole["parameter_changes"]), key=lambda one: one[:2]),
        resets=_calibrations(whole["events"]),
        airborne=[_airborne(message) for message in whole["status"]],
    )


def _messages(path: Path) -> tuple[str, Gathered]:
    """Return the vehicle of the log's IMU, and its messages by topic without namespace."""
    read = ReadState()
    spaces = (
        message.topic.rpartition("/")[0]
        for message in read_log(path, state=read)
        if message.topic.rpartition("/")[2] == "imu"
    )
    space = next(spaces, None)
    if space is None:
        _check_whole(path, read)
        raise LogFormatError(
            f"{path} has no IMU samples (topic /…/imu); "
            "replay a log of `quadlab fly`, or one of the vehicle's folder onboard/"
        )
    vehicle = space.strip("/")
    odometries = partial(_odometries, vehicle=vehicle)
    samples = partial(_samples, vehicle=vehicle)
    found = Gathered(path, {"imu": samples, "state": odometries, "truth": odometries})
    read = ReadState()
    for message in read_log(path, state=read):
        of, _, name = message.topic.rpartition("/")
        if name in WANTED and of.strip("/") == vehicle:
            found.add(name, message)
    _check_whole(path, read)
    return vehicle, found


def _check_whole(path: Path, read: ReadState) -> None:
    """Raise LogFormatError when something of the log could not be read."""
    if not read.closed:
        raise LogFormatError(
            f"{path} is torn: it {read.tear}; "
            f"`quadlab log recover {path}` mends it, then replay it again"
        )
    if read.damaged_chunks or read.damaged_records:
        raise LogFormatError(
            f"{path} is damaged ({read.damaged_chunks} chunks, {read.damaged_records} other "
            "records), so a replay would not be of this flight; see: quadlab log check"
        )


def _parameters(path: Path) -> FlightParameters:
    """Return the parameters at the start of the flight; names that are no longer known are left
    out.
    """
    parameters = FlightParameters().model_copy(deep=True)
    attached = read_attachments(path).get("parameters.json")
    if attached is None:
        return parameters
    store = ParameterStore(parameters)
    try:
        values = json_value(attached)
        if not isinstance(values, dict):
            raise ValueError("they are no names with values")
        store.preset({name: values[name] for name in store.names if name in values})
    except (ValueError, TypeError, ParameterError) as error:
        raise LogFormatError(
            f"{path}: its parameters are not this version's ({error}); "
            "replay it with the version in its metadata"
        ) from error
    return parameters


def _samples(payloads: list[bytes], vehicle: str) -> Columns:
    """Return IMU_SAMPLE (N,)."""
    imu = layout("sensor_msgs/Imu", body_frame(vehicle)).decode_many(payloads)
    samples = np.zeros(len(imu), IMU_SAMPLE)
    samples["stamp_ns"] = _stamps(imu)
    samples["specific_force_b"] = imu["linear_acceleration"]
    samples["angular_velocity_b"] = imu["angular_velocity"]
    return [samples]


def _odometries(payloads: list[bytes], vehicle: str) -> Columns:
    """Return stamps (N,) and STATE (N,)."""
    states = np.zeros(len(payloads), STATE)
    if not payloads:
        return [np.zeros(0, np.int64), states]
    try:
        read = layout("nav_msgs/Odometry", WORLD, body_frame(vehicle)).decode_many(payloads)
    except LinkError:  # other frames: a foreign node's
        each = [decode_odometry(payload, vehicle) for payload in payloads]
        stamps = np.array([stamp for stamp, _ in each], np.int64)
        return [stamps, np.concatenate([one for _, one in each])]
    states["position_w"] = read["pose.pose.position"]
    states["quaternion_wb"] = read["pose.pose.orientation"][:, FROM_ROS]
    states["velocity_w"] = np.column_stack(
        rotate(states["quaternion_wb"].T, read["twist.twist.linear"].T)
    )
    states["angular_velocity_b"] = read["twist.twist.angular"]
    return [_stamps(read), states]


def _stamps(messages: Record) -> Stamps:
    seconds = messages["header.stamp.sec"].astype(np.int64)
    stamps: Stamps = seconds * SECOND_NS + messages["header.stamp.nanosec"]
    return stamps


def _newest(stamps_ns: Stamps, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the rows newer than all before them; the vehicle's tick passes over the others too."""
    newest = np.maximum.accumulate(stamps_ns)
    newer = np.concatenate([np.ones(min(1, len(newest)), bool), newest[1:] > newest[:-1]])
    return rows if newer.all() else rows[newer]


def _arrivals(messages: list[LogMessage], read: Any) -> list[Arrival]:
    """Return the measurements the vehicle could use: it drops the others when they arrive."""
    out = []
    for message in messages:
        try:
            out.append(Arrival(message.log_ns, read(message.payload)))
        except MeasurementError:
            continue
    return out


def _pose(payload: bytes) -> Record:
    pose = decode_pose(payload)
    poses = layout("geometry_msgs/PoseStamped", WORLD)
    if poses.fits(payload):
        sent = poses.decode(payload)["pose.orientation"][FROM_ROS]
        if abs(float(sent @ sent) - 1.0) < UNIT:
            pose["quaternion_wb"] = sent
    return pose


def _change(message: LogMessage) -> Change:
    change = decode(message.payload, message.type_name)
    value = logged_value(change.new_value)
    return Change(stamp_of(change), int(change.revision), change.name, value)


def _calibrations(messages: list[LogMessage]) -> set[int]:
    events = (decode(message.payload, "rcl_interfaces/Log") for message in messages)
    return {
        event.stamp.sec * SECOND_NS + event.stamp.nanosec
        for event in events
        if event.msg.startswith(CALIBRATED)
    }


def _airborne(message: LogMessage) -> tuple[int, bool]:
    status = decode(message.payload, message.type_name)
    return stamp_of(status), bool(status.airborne)
