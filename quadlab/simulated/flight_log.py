"""The log of a simulated flight: every tick and every message, in the order of their time."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from bearing_sim.emulator import BearingMeasurement
from flight_log.provenance import provenance
from flight_log.writer import Batch, LogWriter
from quadrotor.parameters import ParameterStore
from quadrotor.records import (
    POSE_SAMPLE,
    STATE,
    TICK,
    Array,
    Record,
    Stamps,
    has_attitude,
    pose_sample,
)
from vehicle import mailbox
from vehicle.comms.publish import FLOWN_ON, Publisher
from vehicle_link.messages.cdr_layout import Records
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.topics.measurements import (
    encode_bearings,
    encode_picture,
    pose_messages,
    position_messages,
)
from vehicle_link.topics.rmw_keys import full_name
from vehicle_link.topics.scene import SceneMessages
from vehicle_link.topics.table import TOPICS
from vehicle_link.topics.ticks import (
    actuator_messages,
    imu_messages,
    odometry_messages,
    reference_messages,
    state_messages,
)

GROUP = 5
"""Number of ticks passed at once to the publisher of the slow topics, as in the comms process."""
BATCH = 100 * GROUP
"""Number of ticks encoded and written at once: vectorised, a message costs a fraction of a
microsecond."""


class FlightLog:
    """Writer of all that vehicle, station and simulator would log; its clock is that of the ticks.

    Args:
        path: a new MCAP file.
        vehicle: namespace of the topics.
        store: all parameters, attached to the file at its start, with their defaults.
        run: further entries of the run's metadata.
    """

    def __init__(
        self, path: Path, vehicle: str, store: ParameterStore, run: dict[str, str]
    ) -> None:
        self.path = path
        self._vehicle = vehicle
        values = json.dumps(store.values(), indent=1).encode()
        metadata = {"vehicle": vehicle, "recorder": "simulation", **run, **provenance()}
        # A killed simulation can be flown again, so long chunks are safe.
        defaults = {one.name: one.default for one in store.descriptions()}
        # This vehicle has never accepted a calibration; its parameters are complete.
        in_force = {"in_force": {}, "problem": ""}
        attachments = {
            "parameters.json": values,
            "defaults.json": json.dumps(defaults, indent=1).encode(),
            "calibrations.json": json.dumps(in_force).encode(),
        }
        self._writer = LogWriter(path, metadata, attachments, chunk_age_ns=1_000_000_000)
        # Messages since the last batch was written. Records are stored as bytes: copying a
        # structured record field by field takes ten times as long.
        self._ticks: list[bytes] = []
        self._truths: list[bytes] = []
        self._truth_stamps: list[int] = []
        self._poses: list[tuple[int, Array, Array]] = []
        self._pose_arrivals: list[int] = []
        self._others: dict[tuple[str, str, int], list[tuple[bytes, int, int]]] = {}
        self._now_ns = 0
        # The comms process's publisher decides which slow topic is due; nothing is sent.
        self._publisher = Publisher(None, self, self, vehicle, estimator=lambda: self._estimator)
        self._scene = SceneMessages(vehicle)
        self._estimator = str(store.values()[FLOWN_ON])

    def now_ns(self) -> int:
        """Return simulated time, for the publisher."""
        return self._now_ns

    def tick(self, record: Record) -> None:
        """Log one TICK record, shape (1,)."""
        self._ticks.append(record.tobytes())
        if len(self._ticks) == BATCH:
            self._flush()

    def message(
        self, topic: str, type_name: str, payload: bytes, source_ns: int, log_ns: int
    ) -> None:
        """Log any other message; `topic` without namespace."""
        key = topic, type_name, len(payload)
        self._others.setdefault(key, []).append((payload, log_ns, source_ns))

    def event(self, event: mailbox.Event) -> None:
        self._now_ns = self._newest_ns()
        self._publisher.event(event)

    def readings(self, judged: list[Record]) -> None:
        """Log the readings of one tick, JUDGED_READING (1,) each."""
        self._now_ns = self._newest_ns()
        for one in judged:
            self._publisher.reading(one)

    def parameter_change(self, change: ParameterChange) -> None:
        if change.name == FLOWN_ON:
            self._flush()  # earlier ticks were flown on the previous estimator
            self._estimator = str(change.new)
        self._now_ns = self._newest_ns()
        self._publisher.parameter_change(change)

    def truth(self, stamp_ns: int, state: Record) -> None:
        """Log the simulator's STATE, shape (1,)."""
        self._truth_stamps.append(stamp_ns)
        self._truths.append(state.tobytes())

    def pose(self, stamp_ns: int, position_w: Array, quaternion_wb: Array, log_ns: int) -> None:
        """Log a tracker pose, or the position of a marker, that arrived at `log_ns`."""
        if not has_attitude(quaternion_wb):
            sample = pose_sample(stamp_ns, position_w, quaternion_wb)
            payload = position_messages(sample).tobytes()
            self.put("tracker_position", payload, stamp_ns, log_ns)
            return
        self._poses.append((stamp_ns, position_w, quaternion_wb))
        self._pose_arrivals.append(log_ns)

    def bearings(self, frame: BearingMeasurement, log_ns: int) -> None:
        """Log a frame of emulated bearings that arrived at `log_ns`."""
        payload = encode_bearings(
            frame.stamp_ns, frame.beacon_ids.tolist(), frame.bearings_b, frame.sigma, self._vehicle
        )
        self.put("bearings", payload, frame.stamp_ns, log_ns)

    def picture(self, topic: str, stamp_ns: int, jpeg: bytes, log_ns: int) -> None:
        """Log a picture of a camera that was read at `log_ns`."""
        payload = encode_picture(stamp_ns, jpeg, self._vehicle)
        self.put(topic, payload, stamp_ns, log_ns)

    def put(self, topic: str, payload: bytes, stamp_ns: int, log_ns: int) -> None:
        """Log an encoded message of a topic of the table."""
        self.message(topic, TOPICS[topic].type_name, payload, stamp_ns, log_ns)

    def close(self) -> None:
        """Write the remaining messages and close the file. Raises StorageError."""
        self._flush()
        self._writer.close()

    def _newest_ns(self) -> int:
        """Return the time of the newest tick."""
        if not self._ticks:
            return self._now_ns
        return int(np.frombuffer(self._ticks[-1], TICK)["imu"]["stamp_ns"][0])

    def _flush(self) -> None:
        """Write everything in the order of time; at equal times, in the order of these lines."""
        batches: list[Batch] = []
        if self._ticks:
            ticks = np.frombuffer(b"".join(self._ticks), TICK)
            self._publish(ticks)
            for topic, payload, stamp in self._scene.of(ticks):
                self.put(topic, payload, stamp, stamp)
            stamps = ticks["imu"]["stamp_ns"]
            batches += [
                self._batch("state", state_messages(ticks, self._vehicle), stamps),
                self._batch("reference", reference_messages(ticks), stamps),
                self._batch("imu", imu_messages(ticks, self._vehicle), stamps),
                self._batch("actuators", actuator_messages(ticks, self._vehicle), stamps),
            ]
        for (topic, type_name, size), messages in self._others.items():
            payloads, log_ns, source_ns = zip(*messages, strict=True)
            raw = np.frombuffer(b"".join(payloads), f"V{size}")
            at_source, arrived = np.array(source_ns), np.array(log_ns)
            batches.append(self._batch(topic, raw, at_source, arrived, type_name))
        if self._truths:
            truths = np.frombuffer(b"".join(self._truths), STATE)
            stamps = np.array(self._truth_stamps)
            odometries = odometry_messages(stamps, truths, self._vehicle)
            batches.append(self._batch("truth", odometries, stamps))
        if self._poses:
            samples = np.array(self._poses, POSE_SAMPLE)
            arrivals = np.array(self._pose_arrivals)
            poses = pose_messages(samples)
            batches.append(self._batch("tracker_pose", poses, samples["stamp_ns"], arrivals))
        if batches:
            self._writer.write_batches(batches)
        for kept in (
            self._ticks,
            self._truths,
            self._truth_stamps,
            self._poses,
            self._pose_arrivals,
            self._others,
        ):
            kept.clear()

    def _publish(self, ticks: Record) -> None:
        """Pass the ticks to the publisher in groups, each at the time of its last tick."""
        stamps = ticks["imu"]["stamp_ns"].tolist()
        for end in range(GROUP, len(ticks) + 1, GROUP):
            self._now_ns = stamps[end - 1]
            self._publisher.ticks(ticks[end - GROUP : end])
        self._now_ns = stamps[-1]

    def _batch(
        self,
        topic: str,
        payloads: Records,
        stamps: Stamps,
        log_ns: Stamps | None = None,
        type_name: str = "",
    ) -> Batch:
        """Return messages with their source stamps, logged at `log_ns`, by default at these."""
        type_name = type_name or TOPICS[topic].type_name
        arrivals = stamps if log_ns is None else log_ns
        name = full_name(f"/{self._vehicle}", topic)
        return Batch(name, type_name, payloads, arrivals, stamps)
