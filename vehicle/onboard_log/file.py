"""One onboard log while it is being written, and the part of it that other threads may read."""

from __future__ import annotations

import os
import threading
import time
from array import array
from bisect import bisect_left
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flight_log.file import sync_folder
from flight_log.provenance import provenance
from flight_log.writer import Batch as TopicBatch
from flight_log.writer import LogWriter
from flight_log.writer import Message as LogMessage
from quadrotor.errors import StorageError
from quadrotor.records import TICK, Record
from vehicle_link.messages import definition, type_hash
from vehicle_link.topics.table import TOPICS
from vehicle_link.topics.ticks import (
    actuator_messages,
    imu_messages,
    reference_messages,
    state_messages,
)

PERIOD_S = 1.0


class DiskSync:
    """Thread that flushes one file to the disk, from now until `end`.

    Attributes:
        problem: why something did not reach the disk, in words.
        count: number of flushes.
        slowest: duration of the longest flush, s.
    """

    def __init__(self, path: Path, period_s: float = PERIOD_S) -> None:
        self.path = path
        self.problem = ""
        self.count, self.slowest = 0, 0.0
        self._period_s = period_s
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="log to disk", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Request the thread to end; the closing of the file flushes the rest."""
        self._ended.set()

    def _run(self) -> None:
        try:
            file = os.open(self.path, os.O_RDONLY | os.O_CLOEXEC)
            try:
                sync_folder(self.path.parent)  # the file's name must reach the disk too
                while not self._ended.wait(self._period_s):
                    began = time.perf_counter()
                    os.fdatasync(file)
                    self.slowest = max(self.slowest, time.perf_counter() - began)
                    self.count += 1
            finally:
                os.close(file)
        except OSError as error:
            if not self._ended.is_set():
                self.problem = f"{self.path.name} does not reach the disk: {error.strerror}"


PIECE = 50
"""Largest number of ticks, or messages, per write: 70 kB of ticks."""
LONGEST_NS = 1_000_000_000


class Message(NamedTuple):
    """A message of a topic that is not written in every tick."""

    topic: str  # without namespace
    type_name: str
    payload: bytes
    source_ns: int
    log_ns: int


class Batch(NamedTuple):
    """Consecutive ticks, shape (N,), and when comms read them."""

    ticks: Record
    log_ns: int


class Written:
    """The written part of one file; thread-safe.

    Args:
        start_ns: stamp of its first tick.
        place: offset of its first chunk.

    Attributes:
        closed: whether the file is complete.
    """

    def __init__(self, path: Path, start_ns: int, place: int) -> None:
        self.path = path
        self.start_ns = start_ns
        self.closed = False
        self._places = array("q", [place])
        self._stamps = array("q", [start_ns - 1])

    def mark(self, stamp_ns: int, place: int) -> None:
        """Note that ticks up to `stamp_ns` are before the offset `place`, where a chunk begins.

        Later ticks are after it.
        """
        self._places.append(place)  # first: a reader that finds the stamp also finds the place
        self._stamps.append(stamp_ns)

    @property
    def end_ns(self) -> int:
        """Return the stamp of the newest tick in the file."""
        return self._stamps[-1]

    def place_before(self, stamp_ns: int) -> int:
        """Return the offset from which to read for ticks from `stamp_ns` on."""
        return self._places[max(0, bisect_left(self._stamps, stamp_ns) - 1)]


def prepare(vehicle: str) -> None:
    """Compute cached values in advance: 0.3 s of the interpreter, better spent on the ground."""
    provenance()
    list(_tick_messages(np.zeros(1, TICK), vehicle))
    for topic in TOPICS.values():
        definition(topic.type_name)
        type_hash(topic.type_name)


def runs(ticks: Record) -> Iterator[Record]:
    """Yield ticks, shape (N,), cut where `armed` changes."""
    armed = ticks["status"]["armed"]
    cuts = (np.flatnonzero(armed[1:] != armed[:-1]) + 1).tolist()
    for start, end in zip([0, *cuts], [*cuts, len(ticks)], strict=True):
        yield ticks[start:end]


class OnboardFile:
    """One onboard log, created, written and closed by the log's own thread.

    `write` writes everything that was added in one go, in a third of the time.

    Raises:
        StorageError: here and in every method.
    """

    def __init__(
        self,
        path: Path,
        vehicle: str,
        start_ns: int,
        run: Mapping[str, str],
        attachments: Mapping[str, bytes],
    ) -> None:
        self.path = path
        self._vehicle = vehicle
        self._names: dict[str, str] = {}  # with the namespace
        self._ticks: list[Batch] = []
        self._messages: list[LogMessage] = []
        # `write` ends each chunk.
        self._writer = LogWriter(path, run, attachments, chunk_age_ns=LONGEST_NS)
        self._size = self._writer.size
        self._newest_ns = start_ns - 1
        self._sync = DiskSync(path)
        self.written = Written(path, start_ns, self._size)

    @property
    def size(self) -> int:
        """Return the number of bytes in the file so far."""
        return self._writer.size

    def add_ticks(self, batch: Batch) -> None:
        """Add at least one tick, in the order of the flight."""
        self._ticks.append(batch)

    def add_message(self, message: Message) -> None:
        topic, type_name, payload, source_ns, log_ns = message
        name = self._names.get(topic)
        if name is None:
            name = self._names[topic] = f"/{self._vehicle}/{topic}"
        self._messages.append(LogMessage(name, type_name, payload, log_ns, source_ns))

    def write(self) -> None:
        """Pass everything that was added to the kernel, in one or more separate chunks."""
        batches, messages = self._ticks, self._messages
        self._ticks, self._messages = [], []
        if batches:
            # numpy's concatenate examines all fields again each time: 60 µs.
            ticks = np.frombuffer(b"".join(batch.ticks.tobytes() for batch in batches), TICK)
            received = np.repeat(
                np.array([batch.log_ns for batch in batches], np.int64),
                [len(batch.ticks) for batch in batches],
            )
            for start in range(0, len(ticks), PIECE):
                self._piece(ticks[start : start + PIECE], received[start : start + PIECE])
        for start in range(0, len(messages), PIECE):
            self._writer.write_many(messages[start : start + PIECE])
            self._mark()
        self._writer.close_chunk()
        self._mark()

    def is_in_place(self) -> bool:
        """Return False when another process removed, moved or replaced the file or its folder."""
        return self._writer.is_in_place()

    def check(self) -> None:
        """Raise StorageError when what was written did not reach the disk."""
        if self._sync.problem:
            raise StorageError(self._sync.problem)

    def close(self) -> None:
        try:
            self._sync.end()
            try:
                self.write()
            finally:
                self._writer.close()
        finally:
            self.written.closed = True

    def _piece(self, ticks: Record, received: npt.NDArray[np.int64]) -> None:
        stamps = np.ascontiguousarray(ticks["imu"]["stamp_ns"], np.int64)
        self._writer.write_batches(
            [
                TopicBatch(
                    f"/{self._vehicle}/{topic}", TOPICS[topic].type_name, payloads, received, stamps
                )
                for topic, payloads in _tick_messages(ticks, self._vehicle)
            ]
        )
        self._newest_ns = int(stamps[-1])
        self._mark()

    def _mark(self) -> None:
        """Note the place wherever a chunk was closed: it holds all ticks so far."""
        if self._writer.size != self._size:
            self._size = self._writer.size
            self.written.mark(self._newest_ns, self._size)


def _tick_messages(ticks: Record, vehicle: str) -> Iterator[tuple[str, npt.NDArray[np.void]]]:
    """Yield (topic, messages (N,))."""
    yield "state", state_messages(ticks, vehicle)
    yield "reference", reference_messages(ticks)
    yield "imu", imu_messages(ticks, vehicle)
    yield "actuators", actuator_messages(ticks, vehicle)
