"""The onboard log: every tick from arming to half a second after disarming, in its own thread.

Callers only append to a bounded buffer, so a slow disk costs log lines (counted and said), never
telemetry. The file holds the standard topics, as the station's recording does.
"""

from __future__ import annotations

import shutil
import threading
from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from quadrotor.errors import QuadlabError, StorageError
from quadrotor.records import Record
from vehicle.mailbox import ERROR, INFO
from vehicle_link import topics
from vehicle_link.log import LogWriter, is_closed, recover
from vehicle_link.log.provenance import provenance

FOLDER = "onboard"
BUFFER_BYTES = 8_000_000
AFTER_DISARMING_NS = 500_000_000
FREE_BYTES_MIN = 500_000_000
FREE_CHECK_NS = 1_000_000_000
WAIT_S = 0.5
FILES_KEPT = 2  # of which places are known

Say = Callable[[int, str], None]


class Message(NamedTuple):
    """Of a topic other than those of every tick."""

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
    """One file, as far as it is written; other threads may read it.

    Attributes:
        start_ns: of its first tick.
        closed: nothing will be added.
    """

    def __init__(self, path: Path, start_ns: int) -> None:
        self.path = path
        self.start_ns = start_ns
        self.closed = False
        self._marks: list[tuple[int, int]] = [(start_ns, 0)]  # stamp, place in the file

    def mark(self, stamp_ns: int, place: int) -> None:
        """Ticks after `stamp_ns` stand at `place` or behind it."""
        self._marks.append((stamp_ns, place))

    def place_before(self, stamp_ns: int) -> int:
        """Where to begin to read for ticks from `stamp_ns` on."""
        at = bisect_left(self._marks, (stamp_ns, 0))
        return self._marks[max(0, at - 1)][1]


class OnboardLog:
    """Starts and ends files by the ticks' `armed`.

    Args:
        folder: the data folder; files go to `onboard/` in it.
        vehicle: name, the namespace of the topics.
        parameters: gives the JSON that is attached to each file.
        say: takes (level, text) of an event; called from this log's thread.
        free_bytes: asks the free space of a folder.
        calibrations: gives the JSON of those in force, attached too.
    """

    def __init__(
        self,
        folder: Path,
        vehicle: str,
        parameters: Callable[[], bytes],
        say: Say,
        free_bytes: Callable[[Path], int] = lambda path: shutil.disk_usage(path).free,
        calibrations: Callable[[], bytes] | None = None,
    ) -> None:
        self._folder = folder / FOLDER
        self._vehicle = vehicle
        self._attachments = {"parameters.json": parameters}
        if calibrations is not None:
            self._attachments["calibrations.json"] = calibrations
        self._say = say
        self._free_bytes = free_bytes
        self._buffer: deque[Batch | Message] = deque()
        self._buffered = 0
        self._lost = 0
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._started = False
        self._closing = False
        self._writer: LogWriter | None = None
        self._files: deque[Written] = deque(maxlen=FILES_KEPT)
        self.problem = ""  # why nothing is written, if it should be
        self._stopped = False  # by an error or a full disk, until the next arming
        self._disarmed_ns = 0
        self._checked_ns = 0
        self._thread = threading.Thread(target=self._run, name="onboard log", daemon=True)

    def start(self) -> None:
        """Write from now on, what was buffered until now as well; calls after the first do
        nothing. Wait with it until `parameters` knows what flight's are."""
        if not self._started:
            self._started = True
            self._thread.start()

    def ticks(self, ticks: Record, log_ns: int) -> None:
        """All ticks, in order, shape (N,), as read at this time of the vehicle's clock."""
        self._append(Batch(ticks, log_ns), ticks.nbytes, len(ticks))
        self._wake.set()

    def message(
        self, topic: str, type_name: str, payload: bytes, source_ns: int, log_ns: int
    ) -> None:
        """Any other topic, from any thread; kept while a file is open."""
        self._append(Message(topic, type_name, payload, source_ns, log_ns), len(payload), 1)

    def files(self) -> list[Written]:
        """The newest ones of this process, oldest first; from any thread."""
        return list(self._files)

    def close(self, timeout_s: float = 5.0) -> None:
        """Write what is buffered and close the file."""
        self.start()
        self._closing = True
        self._wake.set()
        self._thread.join(timeout_s)

    def _append(self, item: Batch | Message, size: int, count: int) -> None:
        with self._lock:
            if self._buffered + size > BUFFER_BYTES:
                self._lost += count
                return
            self._buffer.append(item)
            self._buffered += size

    def _take(self) -> tuple[list[Batch | Message], int]:
        with self._lock:
            items, lost = list(self._buffer), self._lost
            self._buffer.clear()
            self._buffered = self._lost = 0
        return items, lost

    # -------------------------------------------------------------- the log's own thread
    def _run(self) -> None:
        while True:
            closing = self._closing
            items, lost = self._take()
            if lost:
                self._say(ERROR, f"onboard log lost {lost} ticks or messages: the disk is slow")
            for item in items:
                try:
                    self._store(item)
                except StorageError as error:
                    self._stop(str(error))
            if closing:
                break
            if not items:
                self._wake.wait(WAIT_S)
            self._wake.clear()
        self._finish()

    def _store(self, item: Batch | Message) -> None:
        if isinstance(item, Message):
            if self._writer is not None:
                self._write(self._writer, item)
            return
        for ticks in _runs(item.ticks):
            stamps = ticks["imu"]["stamp_ns"]
            if ticks["status"]["armed"][0]:
                self._disarmed_ns = 0
                if self._writer is None and not self._stopped:
                    self._start(int(stamps[0]))
                self._write_ticks(Batch(ticks, item.log_ns))
                continue
            self._stopped = False
            self._disarmed_ns = self._disarmed_ns or int(stamps[0])
            kept = ticks[stamps <= self._disarmed_ns + AFTER_DISARMING_NS]
            self._write_ticks(Batch(kept, item.log_ns))
            if len(kept) < len(ticks):
                self._finish()

    def _start(self, stamp_ns: int) -> None:
        self._check_space(stamp_ns)
        instant = datetime.fromtimestamp(stamp_ns / 1e9, UTC)
        stem = f"{self._vehicle}_{instant:%Y%m%dT%H%M%S}_{instant.microsecond // 1000:03d}Z"
        run = {"run_id": stem, "vehicle": self._vehicle, "recorder": "onboard", **provenance()}
        path = self._folder / f"{stem}.mcap"
        attachments = {name: text() for name, text in self._attachments.items()}
        self._writer = LogWriter(path, run, attachments)
        self._files.append(Written(path, stamp_ns))
        self.problem = ""
        self._say(INFO, f"onboard log {path.name} started")

    def _write_ticks(self, batch: Batch) -> None:
        writer, ticks = self._writer, batch.ticks
        if writer is None or not len(ticks):
            return
        stamps: list[int] = ticks["imu"]["stamp_ns"].tolist()
        checked_ns = self._checked_ns
        self._check_space(stamps[-1])
        if self._checked_ns != checked_ns:  # once a second
            self._files[-1].mark(stamps[0] - 1, writer.size)
        for topic, payloads in (
            ("state", topics.encode_states(ticks, self._vehicle)),
            ("reference", topics.encode_references(ticks)),
            ("imu", topics.encode_imus(ticks, self._vehicle)),
            ("actuators", topics.encode_actuators(ticks, self._vehicle)),
        ):
            type_name = topics.TOPICS[topic].type_name
            for stamp_ns, payload in zip(stamps, payloads, strict=True):
                self._write(writer, Message(topic, type_name, payload, stamp_ns, batch.log_ns))

    def _write(self, writer: LogWriter, message: Message) -> None:
        topic, type_name, payload, source_ns, log_ns = message
        writer.write(f"/{self._vehicle}/{topic}", type_name, payload, log_ns, source_ns)

    def _check_space(self, now_ns: int) -> None:
        if 0 <= now_ns - self._checked_ns < FREE_CHECK_NS:
            return
        self._checked_ns = now_ns
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            free = self._free_bytes(self._folder)
        except OSError as error:
            raise StorageError(f"cannot use {self._folder}: {error.strerror}") from error
        if free < FREE_BYTES_MIN:
            raise StorageError(
                f"{free // 10**6} MB free in {self._folder}, needs {FREE_BYTES_MIN // 10**6} MB; "
                "delete old runs"
            )

    def _stop(self, reason: str) -> None:
        self._say(ERROR, f"onboard log stopped: {reason}")
        self.problem = reason
        self._stopped = True
        self._checked_ns = 0
        self._finish()

    def _finish(self) -> None:
        writer, self._writer = self._writer, None
        if writer is None:
            return
        try:
            writer.close()
        except StorageError as error:
            self._say(ERROR, f"onboard log not closed, recovered at the next start: {error}")
            return
        finally:
            self._files[-1].closed = True
        megabytes = writer.size / 1e6
        self._say(INFO, f"onboard log {writer.path.name} closed, {megabytes:.1f} MB")


def _runs(ticks: Record) -> Iterator[Record]:
    """Cut where `armed` changes."""
    armed = ticks["status"]["armed"]
    cuts = (np.flatnonzero(armed[1:] != armed[:-1]) + 1).tolist()
    for start, end in zip([0, *cuts], [*cuts, len(ticks)], strict=True):
        yield ticks[start:end]


def torn_logs(data: Path) -> list[Path]:
    """Onboard logs that were never closed. Raises StorageError."""
    folder = data / FOLDER
    return [path for path in sorted(folder.glob("*.mcap")) if not is_closed(path)]


def recover_logs(paths: list[Path]) -> Iterator[str]:
    """Mend each; yields one line a file. A file that cannot be mended stays as it is."""
    for path in paths:
        try:
            found = recover(path)
        except QuadlabError as error:
            yield f"onboard log {path.name} not recovered: {error}"
        else:
            if found.torn:
                yield f"onboard log {path.name} recovered: {found.messages} messages"
