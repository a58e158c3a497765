"""The content of a log for a replay: samples, truth, measurements with arrivals, parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from estimation import names
from estimation.names import NONE
from flight_log.attached import PARAMETERS, json_value, logged_value
from flight_log.columns.log_columns import LogColumns, read_columns
from flight_log.columns.topic import Topic
from flight_log.fields import FORCE, ODOMETRY, RATE, TURNING_B
from flight_log.index import NO_END, is_closed
from flight_log.payload_layout import HEADER_STAMP
from flight_log.run_folder import IMPORTED
from flight_log.writer import RUN_METADATA
from quadlab.recording.rest import bias_at_rest
from quadlab.simulated.parameters import FlightParameters
from quadrotor.errors import LogFormatError, MeasurementError, ParameterError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from quadrotor.plain_rotations import rotate
from quadrotor.records import IMU_SAMPLE, STATE, Record, Stamps
from vehicle.estimators.choice import ESTIMATOR, SHADOW
from vehicle_link.messages import decode, stamp_of
from vehicle_link.messages.records import ParameterChange
from vehicle_link.topics.measurements import (
    decode_bearings,
    decode_pose,
    decode_position,
    decode_sweeps,
)
from vehicle_link.topics.ticks import FROM_ROS, SECOND_NS, WORLD, layout

Floats = npt.NDArray[np.float64]

COLUMNS = ("imu", "state", "truth", "status")
EVENTS = ("tracker_pose", "tracker_position", "bearings", "sweeps", "events", "parameter_changes")
MAX_SAMPLES = 2_000_000
"""Largest number of samples of a topic: more than an hour's flight at 500 Hz."""
CALIBRATED, ARMED = "ready: gyroscope bias", "armed: "
"""Beginnings of the events at whose sample the vehicle's estimators forget what they have learnt,
and adopt the stated heading."""
UNIT = 1e-14
"""A quaternion this close to unit length is used as it was sent, as simulated flights do."""


class Arrival(NamedTuple):
    """A measurement and when the vehicle received it; it acts at the first sample after that."""

    arrival_ns: int
    measurement: Record
    """POSE_SAMPLE, BEARINGS_SAMPLE without positions, or SWEEPS_SAMPLE, (1,)."""


class Change(NamedTuple):
    """A change of a parameter in flight, after this sample; changes of one revision are
    simultaneous.
    """

    stamp_ns: int
    revision: int
    name: str
    value: ParameterValue


@dataclass
class Recording:
    """One vehicle's flight; stamps in ns on its clock, times in s since its first IMU sample."""

    path: Path
    vehicle: str
    imu: Record  # (N,) IMU_SAMPLE, in order
    state_ns: Stamps  # (M,)
    state: Record  # (M,) STATE: the estimate that was flown on
    truth_ns: Stamps
    truth: Record  # STATE
    poses: list[Arrival]
    bearings: list[Arrival]
    sweeps: list[Arrival]
    parameters: FlightParameters
    parameters_recorded: bool = True  # False: an imported flight, with this version's defaults
    changes: list[Change] = field(default_factory=list)
    resets: set[int] = field(default_factory=set)  # stamps of samples
    armed: set[int] = field(default_factory=set)
    airborne: list[tuple[int, bool]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)  # what was done to the log's values

    @property
    def start_ns(self) -> int:
        return int(self.imu["stamp_ns"][0])

    def seconds(self, stamps_ns: Any) -> Any:
        """Return the time of stamps, s."""
        return 1e-9 * (stamps_ns - self.start_ns)


def read_recording(path: Path) -> Recording:
    """Read a log for a replay. Raises StorageError, LogFormatError with what to do."""
    log = read_columns(path, dtype=np.float64)
    found = log.topics
    _check_whole(path, log)
    space = next((name.rpartition("/")[0] for name in found if name.endswith("/imu")), None)
    if space is None:
        raise LogFormatError(
            f"{path} has no IMU samples (topic /…/imu); "
            "replay a log of `quadlab fly`, or one from the vehicle's folder onboard/"
        )
    topics = {name: found.get(f"{space}/{name}") or Topic() for name in (*COLUMNS, *EVENTS)}
    for name in ("imu", "state", "truth"):
        if problem := log.problems.get(f"{space}/{name}"):
            raise LogFormatError(f"{path}: {name} cannot be read: {problem}")
        _check_length(path, name, topics[name])
    samples_ns, samples = _imu_samples(topics["imu"])
    state_ns, state = _states(topics["state"])
    truth_ns, truth = _states(topics["truth"])
    status_ns, airborne = _stamped(topics["status"], ("airborne",))
    imported = log.metadata.get(RUN_METADATA, {}).get("recorder") == IMPORTED
    samples = _newest(samples_ns, samples)
    notes = [_without_bias(samples)] if imported and len(samples) else []
    return Recording(
        path,
        space.strip("/"),
        imu=samples,
        state_ns=state_ns,
        state=state,
        truth_ns=_newest(truth_ns, truth_ns),
        truth=_newest(truth_ns, truth),
        poses=sorted(
            (
                *_arrivals(topics["tracker_pose"], _pose),
                *_arrivals(topics["tracker_position"], decode_position),
            ),
            key=itemgetter(0),
        ),
        bearings=_arrivals(topics["bearings"], decode_bearings),
        sweeps=_arrivals(topics["sweeps"], decode_sweeps),
        parameters=_parameters(path, log.attachments),
        parameters_recorded=PARAMETERS in log.attachments and not imported,
        changes=sorted(map(_change, _messages(topics["parameter_changes"])), key=itemgetter(0, 1)),
        resets=_told(topics["events"], CALIBRATED),
        armed=_told(topics["events"], ARMED),
        airborne=list(zip(status_ns.tolist(), (airborne[:, 0] > 0.0).tolist(), strict=True)),
        notes=notes,
    )


def _without_bias(samples: Record) -> str:
    """Take the gyroscope's bias at rest off IMU_SAMPLE (N,), as a vehicle does at its start; return
    a line about it.
    """
    found = bias_at_rest(samples)
    if found is None:
        return "the log begins without a second at rest: the gyroscope's bias is not taken off"
    samples["angular_velocity_b"] -= found.bias_b
    degrees = ", ".join(f"{one:.2f}" for one in np.degrees(found.bias_b))
    return f"gyroscope bias {degrees} °/s, found at rest, is taken off"


def _check_length(path: Path, name: str, topic: Topic) -> None:
    """Raise LogFormatError when a topic has more messages than are replayed."""
    if len(topic) > MAX_SAMPLES:
        raise LogFormatError(
            f"{path.name} has {len(topic)} messages of {name}, at most {MAX_SAMPLES} are replayed: "
            "cut it with `mcap filter --include-attachments --output-compression lz4 --start … "
            "--end …`"
        )


def _imu_samples(topic: Topic) -> tuple[Stamps, Record]:
    """Return the stamps, (N,), and the samples, (N,) IMU_SAMPLE."""
    samples_ns, imu = _stamped(topic, FORCE + RATE)
    samples = np.zeros(len(imu), IMU_SAMPLE)
    samples["stamp_ns"] = samples_ns
    samples["specific_force_b"], samples["angular_velocity_b"] = imu[:, :3], imu[:, 3:]
    return samples_ns, samples


def _check_whole(path: Path, log: LogColumns) -> None:
    """Raise LogFormatError when a part of the log could not be read."""
    if log.tear or not is_closed(path):
        raise LogFormatError(
            f"{path} is torn: it {log.tear or NO_END}; "
            f"`quadlab log recover {path}` repairs it, then replay it again"
        )
    if log.damaged_chunks or log.damaged_records:
        raise LogFormatError(
            f"{path} is damaged ({log.damaged_chunks} chunks, {log.damaged_records} other "
            "records), so a replay would not be of this flight; see: quadlab log check"
        )


def _parameters(path: Path, attachments: Mapping[str, bytes]) -> FlightParameters:
    """Return the parameters at the start of the flight; unknown names are left out."""
    parameters = FlightParameters().model_copy(deep=True)
    attached = attachments.get(PARAMETERS)
    if attached is None:
        return parameters
    try:
        values = json_value(attached)
        if not isinstance(values, dict):
            raise ValueError("they are not names with values")
        chosen = {str(values[name]) for name in (ESTIMATOR, SHADOW) if name in values}
        names.offer(sorted(chosen - {*names.names(), NONE}))  # plugins of that vehicle
        store = ParameterStore(parameters)
        store.preset({name: values[name] for name in store.names if name in values})
    except (ValueError, TypeError, ParameterError) as error:
        raise LogFormatError(
            f"{path}: its parameters are not this version's ({error}); "
            "replay it with the version in its metadata"
        ) from error
    return parameters


def _stamped(topic: Topic, names: Sequence[str]) -> tuple[Stamps, Floats]:
    """Return the stamps of the headers, (N,), and numbers, (N, len(names)). Raises
    LogFormatError.
    """
    for name in (*HEADER_STAMP, *names):
        if len(topic) and name not in topic:
            raise LogFormatError(f"a {topic.type_name} without {name} cannot be replayed")
    return topic.header_ns, topic.take(names).astype(np.float64, copy=False)


def _states(topic: Topic) -> tuple[Stamps, Record]:
    """Return stamps (N,) and STATE (N,) from odometries."""
    stamps, rows = _stamped(topic, ODOMETRY + TURNING_B)
    states = np.zeros(len(rows), STATE)
    states["position_w"], states["quaternion_wb"] = rows[:, :3], rows[:, 3:7]
    states["velocity_w"] = np.column_stack(rotate(states["quaternion_wb"].T, rows[:, 7:10].T))
    states["angular_velocity_b"] = rows[:, 10:]
    return stamps, states


def _newest(stamps_ns: Stamps, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the rows newer than all before them; the vehicle's tick also skips the others."""
    newest = np.maximum.accumulate(stamps_ns)
    newer = np.concatenate([np.ones(min(1, len(newest)), bool), newest[1:] > newest[:-1]])
    return rows if newer.all() else rows[newer]


def _arrivals(topic: Topic, read: Callable[[bytes], Record]) -> list[Arrival]:
    """Return the measurements that the vehicle could use: it drops the others on arrival."""
    out = []
    for log_ns, payload in zip(topic.log_ns.tolist(), topic.payloads, strict=True):
        with suppress(MeasurementError):
            out.append(Arrival(log_ns, read(payload)))
    return out


def _pose(payload: bytes) -> Record:
    pose = decode_pose(payload)
    poses = layout("geometry_msgs/PoseStamped", WORLD)
    if poses.fits(payload):
        sent = poses.decode(payload)["pose.orientation"][FROM_ROS]
        if abs(float(sent @ sent) - 1.0) < UNIT:
            pose["quaternion_wb"] = sent
    return pose


def _messages(topic: Topic) -> Iterator[Any]:
    return (decode(payload, topic.decodable_name) for payload in topic.payloads)


def _change(change: ParameterChange) -> Change:
    value = logged_value(change.new_value)
    return Change(stamp_of(change), int(change.revision), change.name, value)


def _told(events: Topic, words: str) -> set[int]:
    """Return the stamps of the events that begin with these words."""
    return {
        event.stamp.sec * SECOND_NS + event.stamp.nanosec
        for event in _messages(events)
        if event.msg.startswith(words)
    }
