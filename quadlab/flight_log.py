"""The log of a simulated flight: every tick and every message, in the order of their time."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import numpy.typing as npt

from bearing_sim.emulator import BearingMeasurement
from quadrotor.parameters import ParameterStore
from quadrotor.records import POSE_SAMPLE, TICK, Record
from vehicle import mailbox
from vehicle.comms_publish import Publisher
from vehicle_link import topics
from vehicle_link.log import LogWriter
from vehicle_link.log.provenance import provenance

Array = npt.NDArray[np.float64]

BATCH = 50
"""Ticks encoded at once: vectorised, a message costs a fraction of a microsecond."""
GROUP = 5
"""Ticks handed at once to the publisher of the slow topics, as the comms process does."""
PER_TICK = ("state", "reference", "imu", "actuators")


class FlightLog:
    """Writes what vehicle, station and simulator would log; the clock is the ticks' own.

    Args:
        path: a new MCAP file.
        vehicle: namespace of the topics.
        store: all parameters, attached to the file at its start.
        run: further entries of the run's metadata.
    """

    def __init__(
        self, path: Path, vehicle: str, store: ParameterStore, run: dict[str, str]
    ) -> None:
        self.path = path
        self._vehicle = vehicle
        values = json.dumps(store.values(), indent=1).encode()
        metadata = {"vehicle": vehicle, "recorder": "simulation", **run, **provenance()}
        # Simulated time is not lost with a killed process: it is flown again. So whole chunks.
        attachments = {"parameters.json": values}
        self._writer = LogWriter(path, metadata, attachments, chunk_age_ns=1_000_000_000)
        self._ticks = np.zeros(BATCH, TICK)
        self._tick_bytes = self._ticks.view(np.uint8).reshape(BATCH, TICK.itemsize)
        self._stamps = self._ticks["imu"]["stamp_ns"]
        self._count = 0
        self._grouped = 0
        self._others: list[tuple[int, str, str, bytes, int]] = []
        self._truths: list[Record] = []
        self._truth_stamps: list[int] = []
        self._poses: list[tuple[int, Array, Array]] = []
        self._pose_arrivals: list[int] = []
        self._now_ns = 0
        # The publisher of the comms process decides which slow topic is due; nothing is sent.
        self._publisher = Publisher(None, self, self, vehicle)  # type: ignore[arg-type]

    def now_ns(self) -> int:
        """Simulated time, for the publisher."""
        return self._now_ns

    def tick(self, record: Record) -> None:
        """One TICK record, shape (1,)."""
        # As bytes: copying a structured record field by field takes ten times as long.
        self._tick_bytes[self._count] = record.view(np.uint8)
        self._now_ns = int(self._stamps[self._count])
        self._count += 1
        if self._count - self._grouped == GROUP:
            self._publisher.ticks(self._ticks[self._grouped : self._count])
            self._grouped = self._count
        if self._count == BATCH:
            self._flush()

    def message(
        self, topic: str, type_name: str, payload: bytes, source_ns: int, log_ns: int
    ) -> None:
        """Any other message; `topic` without namespace."""
        self._others.append((log_ns, topic, type_name, payload, source_ns))

    def event(self, event: mailbox.Event) -> None:
        self._publisher.event(event)

    def parameter_change(self, change: mailbox.ParameterChange) -> None:
        self._publisher.parameter_change(change)

    def truth(self, stamp_ns: int, state: Record) -> None:
        """The simulator's STATE, shape (1,)."""
        self._truth_stamps.append(stamp_ns)
        self._truths.append(state.copy())

    def pose(
        self,
        stamp_ns: int,
        position_w: Array,
        quaternion_wb: Array,
        log_ns: int,
    ) -> None:
        """A tracker pose that arrived at `log_ns`."""
        self._poses.append((stamp_ns, position_w, quaternion_wb))
        self._pose_arrivals.append(log_ns)

    def bearings(self, frame: BearingMeasurement, log_ns: int) -> None:
        """A frame of emulated bearings that arrived at `log_ns`."""
        payload = topics.encode_bearings(
            frame.stamp_ns, frame.beacon_ids, frame.bearings_b, frame.sigma, self._vehicle
        )
        self._put("bearings", payload, frame.stamp_ns, log_ns)

    def bearing_pose(self, stamp_ns: int, payload: bytes, log_ns: int) -> None:
        """The one-frame pose solved from a frame of bearings, encoded."""
        self._put("bearing_pose", payload, stamp_ns, log_ns)

    def close(self) -> None:
        """Write what is left and close the file. Raises StorageError."""
        self._flush()
        self._writer.close()

    def _put(self, topic: str, payload: bytes, stamp_ns: int, log_ns: int) -> None:
        self.message(topic, topics.TOPICS[topic].type_name, payload, stamp_ns, log_ns)

    def _encode_batches(self) -> None:
        """Truth and tracker poses, kept as records until now: encoding many at once is cheap."""
        if self._truths:
            stamps = np.array(self._truth_stamps)
            payloads = topics.encode_odometries(stamps, np.concatenate(self._truths), self._vehicle)
            for stamp_ns, payload in zip(self._truth_stamps, payloads, strict=True):
                self._put("truth", payload, stamp_ns, stamp_ns)
        if self._poses:
            samples = np.array(self._poses, POSE_SAMPLE)
            payloads = topics.encode_poses(samples)
            for pose, payload, log_ns in zip(
                self._poses, payloads, self._pose_arrivals, strict=True
            ):
                self._put("tracker_pose", payload, pose[0], log_ns)
        for batch in (self._truths, self._truth_stamps, self._poses, self._pose_arrivals):
            batch.clear()
        self._others.sort(key=_log_time)

    def _flush(self) -> None:
        self._encode_batches()
        ticks = self._ticks[: self._count]
        rows = zip(
            ticks["imu"]["stamp_ns"].tolist(),
            topics.encode_states(ticks, self._vehicle),
            topics.encode_references(ticks),
            topics.encode_imus(ticks, self._vehicle),
            topics.encode_actuators(ticks, self._vehicle),
            strict=True,
        )
        prefix = f"/{self._vehicle}/"
        names = [(prefix + topic, topics.TOPICS[topic].type_name) for topic in PER_TICK]
        write = self._writer.write
        others = self._others
        position = 0
        for stamp_ns, *payloads in rows:
            while position < len(others) and others[position][0] < stamp_ns:
                self._write_other(others[position])
                position += 1
            for (topic, type_name), payload in zip(names, payloads, strict=True):
                write(topic, type_name, payload, stamp_ns, stamp_ns)
        for other in others[position:]:
            self._write_other(other)
        others.clear()
        self._count = self._grouped = 0

    def _write_other(self, other: tuple[int, str, str, bytes, int]) -> None:
        log_ns, topic, type_name, payload, source_ns = other
        self._writer.write(f"/{self._vehicle}/{topic}", type_name, payload, log_ns, source_ns)


def _log_time(other: tuple[int, str, str, bytes, int]) -> int:
    return other[0]
