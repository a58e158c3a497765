"""An imported flight as a log, with the topics of any run that the flight has."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from extensions.importers.flight import ImportedFlight
from extensions.importers.rows import release
from flight_log.attached import PARAMETERS
from flight_log.provenance import provenance
from flight_log.run_folder import IMPORTED
from flight_log.writer import Batch, LogWriter
from quadrotor.records import POSE_SAMPLE, TICK, Stamps
from vehicle_link.topics.measurements import pose_messages, position_messages, sweep_messages
from vehicle_link.topics.status import encode_batteries, encode_event
from vehicle_link.topics.table import TOPICS
from vehicle_link.topics.ticks import imu_messages, odometry_messages

SLICE_NS = 3_000_000_000
"""Duration, in ns, of flight that is encoded at once: of 1 kHz and two topics 20 MB."""
POSE_NS = 7_500_000
"""Least time between tracker poses: motion capture may be faster than any tracker sends."""
INFO = 20  # level of rcl_interfaces/Log


def write_run(
    path: Path, flight: ImportedFlight, run: Mapping[str, str], progress: Callable[[float], None]
) -> None:
    """Write a new log; `run` are entries for its metadata. Raises StorageError."""
    metadata = {"vehicle": flight.vehicle, "recorder": IMPORTED, **run, **provenance()}
    attached = {PARAMETERS: json.dumps(flight.parameters).encode()} if flight.parameters else {}
    # A flight can be imported again, so long chunks are safe, as in simulated flights.
    with LogWriter(path, metadata, attached, chunk_age_ns=1_000_000_000) as writer:
        tracks = [one for one in (flight.imu, flight.truth, flight.estimate) if one is not None]
        first = min(int(one.stamps_ns[0]) for one in tracks)
        end = max(int(one.stamps_ns[-1]) for one in tracks) + 1
        for start in range(first, end, SLICE_NS):
            if batches := list(_slice(flight, start, start + SLICE_NS)):
                writer.write_batches(batches)
            progress(min(1.0, (start + SLICE_NS - first) / (end - first)))


def _slice(flight: ImportedFlight, start: int, end: int) -> Iterator[Batch]:
    """Yield the batches from `start` to before `end`, ns."""
    name, imu = flight.vehicle, flight.imu
    if len(rows := _rows(imu.stamps_ns, start, end)):
        ticks = np.zeros(len(rows), TICK)
        ticks["imu"]["stamp_ns"] = imu.stamps_ns[rows]
        ticks["imu"]["specific_force_b"] = imu.specific_force_b[rows]
        ticks["imu"]["angular_velocity_b"] = imu.angular_velocity_b[rows]
        release(imu.specific_force_b, imu.angular_velocity_b)
        yield _batch(flight, "imu", imu_messages(ticks, name), imu.stamps_ns[rows])
    for topic, track in (("state", flight.estimate), ("truth", flight.truth)):
        if track is not None and len(rows := _rows(track.stamps_ns, start, end)):
            stamps = track.stamps_ns[rows]
            made = odometry_messages(stamps, track.record(rows), name)
            yield _batch(flight, topic, made, stamps)
    if flight.truth is not None:
        rows = _rows(flight.truth.stamps_ns, start, end)
        rows = rows[_thinned(flight.truth.stamps_ns[rows])]
        if len(rows):
            poses = np.zeros(len(rows), POSE_SAMPLE)
            poses["stamp_ns"] = flight.truth.stamps_ns[rows]
            poses["position_w"] = flight.truth.states["position_w"][rows]
            poses["quaternion_wb"] = flight.truth.states["quaternion_wb"][rows]
            known = flight.truth.attitude_known
            made = pose_messages(poses) if known else position_messages(poses)
            topic = "tracker_pose" if known else "tracker_position"
            yield _batch(flight, topic, made, poses["stamp_ns"])
    if flight.sweeps is not None:
        sweeps = flight.sweeps[_rows(flight.sweeps["stamp_ns"], start, end)]
        for count in np.unique(sweeps["count"]):
            alike = sweeps[sweeps["count"] == count]
            yield _batch(flight, "sweeps", sweep_messages(alike, name), alike["stamp_ns"])
    if flight.battery is not None:
        stamps, voltage = flight.battery
        if len(rows := _rows(stamps, start, end)):
            ticks = np.zeros(len(rows), TICK)
            ticks["imu"]["stamp_ns"] = stamps[rows]
            ticks["status"]["battery_voltage"] = voltage[rows]
            payloads = encode_batteries(ticks, name)
            raw = np.frombuffer(b"".join(payloads), f"V{len(payloads[0])}")
            yield _batch(flight, "battery", raw, stamps[rows])
    for stamp, level, text in flight.events:
        if start <= stamp < end:
            payload = encode_event(stamp, level, text, f"{name}.vehicle")
            raw = np.frombuffer(payload, f"V{len(payload)}")
            yield _batch(flight, "events", raw, np.array([stamp]))


def _rows(stamps: Stamps, start: int, end: int) -> npt.NDArray[np.intp]:
    low, high = np.searchsorted(stamps, [start, end])
    return np.arange(low, high)


def _thinned(stamps: Stamps) -> npt.NDArray[np.intp]:
    """Return the rows to keep so that they are at least POSE_NS apart."""
    if not len(stamps):
        return np.zeros(0, np.intp)
    step = float(np.median(np.diff(stamps))) if len(stamps) > 1 else POSE_NS
    return np.arange(0, len(stamps), max(1, int(np.ceil(POSE_NS / max(step, 1.0)))))


def _batch(
    flight: ImportedFlight, topic: str, payloads: npt.NDArray[np.void], stamps: Stamps
) -> Batch:
    kind = TOPICS[topic].type_name
    return Batch(f"/{flight.vehicle}/{topic}", kind, payloads, stamps, stamps)
