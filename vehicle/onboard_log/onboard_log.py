"""The onboard log: every tick from arming to half a second after disarming, in its own thread.

Callers only append to a bounded buffer, so a slow disk costs log lines (counted and reported),
never telemetry. The file holds the standard topics, as the station's recording does.
"""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path

from flight_log.provenance import provenance
from quadrotor.errors import QuadlabError, StorageError, os_errors
from quadrotor.records import Record
from vehicle.mailbox import ERROR, INFO, WARN
from vehicle.onboard_log.file import Batch, Message, OnboardFile, Written, prepare, runs
from vehicle.onboard_log.parameters import OnboardLogParameters
from vehicle.onboard_log.repair import FOLDER, LogRepair
from vehicle.onboard_log.ring import Fetched, Ring, free_bytes

BUFFER_BYTES = 32_000_000
AFTER_DISARMING_NS = 500_000_000
CHECK_NS = 1_000_000_000
PERIOD_S = 0.035
"""Time, in s, between two writes of 0.7 ms; a killed process loses as much of the slow topics."""
FILES_KEPT = 4  # whose places are stored

Say = Callable[[int, str], None]


class OnboardLog:
    """Log that begins and ends a file with the ticks' `armed`.

    Args:
        data: the data folder; files are written to `onboard/` in it.
        vehicle: name, the namespace of the topics.
        attachments: name → returns the content to attach to each file when it begins.
        say: called with (level, text) of an event, on this log's thread.
        facts: for the metadata `quadlab.run`, in addition to what is known here.
        limits: returns the parameters of the log.
        fetched: tracks which files the station reads.
        free: returns the free space of a folder, in bytes.
        written: called with the number of further ticks that are written or discarded.
    """

    def __init__(
        self,
        data: Path,
        vehicle: str,
        attachments: Mapping[str, Callable[[], bytes]],
        say: Say,
        *,
        facts: Mapping[str, str] | None = None,
        limits: Callable[[], OnboardLogParameters] = OnboardLogParameters,
        fetched: Fetched | None = None,
        free: Callable[[Path], int] = free_bytes,
        written: Callable[[int], None] = lambda count: None,
    ) -> None:
        self.folder = data / FOLDER
        self._vehicle = vehicle
        self._attachments = dict(attachments)
        self._facts = dict(facts or {})
        self._say = say
        self._limits = limits
        self._free = free
        self._written = written
        self._ring = Ring(self.folder, fetched, free)
        self.repair = LogRepair(data, say, free, lambda: self.stop_bytes)
        self._buffer: list[Batch | Message] = []
        self._buffered = 0
        self._lost = self._lost_ticks = 0
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._started = False
        self._file: OnboardFile | None = None
        self._files: deque[Written] = deque(maxlen=FILES_KEPT)
        self.problem = ""  # why nothing is written although it should be
        self._stopped = False  # by an error or a full disk, until the next arming
        self._disarmed_ns = 0
        self._checked_ns = 0
        self._tidy_due = True  # whether to tidy the ring when next on the ground
        self._thread = threading.Thread(target=self._run, name="onboard log", daemon=True)

    def start(self) -> None:
        """Start writing, including the buffered messages; further calls have no effect.

        Call it once `attachments` can return flight's parameters.
        """
        if not self._started:
            self._started = True
            self._thread.start()

    def ticks(self, ticks: Record, log_ns: int) -> None:
        """Log all ticks, in order, shape (N,), as read at this time of the vehicle's clock."""
        if not self._append(Batch(ticks, log_ns), ticks.nbytes, len(ticks)):
            with self._lock:
                self._lost_ticks += len(ticks)

    def message(
        self, topic: str, type_name: str, payload: bytes, source_ns: int, log_ns: int
    ) -> None:
        """Log a message of any other topic, from any thread; it is written while a file is open."""
        self._append(Message(topic, type_name, payload, source_ns, log_ns), len(payload), 1)

    @property
    def stop_bytes(self) -> int:
        return self._limits().stop_bytes  # of free space, below which nothing is logged

    def files(self) -> list[Written]:
        """Return the newest files of this process, oldest first; from any thread."""
        return list(self._files)

    def close(self, timeout_s: float = 5.0) -> None:
        """Write the buffered messages and close the file."""
        self.start()
        self._closed.set()
        self._thread.join(timeout_s)

    def _append(self, item: Batch | Message, size: int, count: int) -> bool:
        """Append, and return False when the buffer is full."""
        with self._lock:
            if self._buffered + size > BUFFER_BYTES:
                self._lost += count
                return False
            self._buffer.append(item)
            self._buffered += size
        return True

    def _pop_buffer(self) -> tuple[list[Batch | Message], int, int]:
        """Remove and return the queued items, the number lost in all, and the ticks among those."""
        with self._lock:
            items, lost, ticks = self._buffer, self._lost, self._lost_ticks
            self._buffer, self._buffered, self._lost, self._lost_ticks = [], 0, 0, 0
        return items, lost, ticks

    # -------------------------------------------------------------- the log's own thread
    def _run(self) -> None:
        prepare(self._vehicle)
        while True:
            closing = self._closed.is_set()
            items, lost, lost_ticks = self._pop_buffer()
            if lost:
                self._say(ERROR, f"onboard log lost {lost} ticks or messages: the disk is slow")
            self._store(items)
            self._written(lost_ticks + sum(len(i.ticks) for i in items if isinstance(i, Batch)))
            if closing:
                break
            self._maintain(bool(self._disarmed_ns) and self._file is None)
            self._closed.wait(PERIOD_S)
        self._finish()
        self.repair.close()

    def _maintain(self, on_ground: bool) -> None:
        """Maintain the closed files, and those that could not be closed."""
        if on_ground and self._tidy_due:
            self._tidy()
        for path in self.repair.step(on_ground):
            self._tidy_due = True
            for written in self.files():
                if written.path == path:  # its places refer to another file
                    self._files.remove(written)

    def _store(self, items: Iterable[Batch | Message]) -> None:
        for item in items:
            try:
                self._add(item)
            except StorageError as error:
                self._stop(str(error))
        try:
            if self._file is not None:
                self._file.write()
        except StorageError as error:
            self._stop(str(error))

    def _add(self, item: Batch | Message) -> None:
        if isinstance(item, Message):
            if self._file is not None:
                self._file.add_message(item)
            return
        for ticks in runs(item.ticks):
            stamps = ticks["imu"]["stamp_ns"]
            if ticks["status"]["armed"][0]:
                self._disarmed_ns = 0
                if self._file is None and not self._stopped:
                    self._start(int(stamps[0]))
                    self.problem = ""
                self._add_ticks(Batch(ticks, item.log_ns))
                continue
            self._stopped = False
            self._disarmed_ns = self._disarmed_ns or int(stamps[0])
            kept = ticks[stamps <= self._disarmed_ns + AFTER_DISARMING_NS]
            self._add_ticks(Batch(kept, item.log_ns))
            if len(kept) < len(ticks):
                self._finish()

    def _start(self, stamp_ns: int) -> None:
        """Start a file. Raises StorageError."""
        self._check_space(stamp_ns)
        instant = datetime.fromtimestamp(stamp_ns / 1e9, UTC)
        stem = f"{self._vehicle}_{instant:%Y%m%dT%H%M%S}_{instant.microsecond // 1000:03d}Z"
        stem = self._free_name(stem)
        run = {"run_id": stem, "vehicle": self._vehicle, "recorder": "onboard"}
        self._file = OnboardFile(
            self.folder / f"{stem}.mcap",
            self._vehicle,
            stamp_ns,
            {**run, **self._facts, **provenance()},
            dict(self._attached()),
        )
        self._files.append(self._file.written)
        self._say(INFO, f"onboard log {self._file.path.name} started")

    def _free_name(self, stem: str) -> str:
        """Return an unused name.

        A comms process killed at arming leaves a file that begins with the same tick.
        """
        names = itertools.chain([stem], (f"{stem}_{number}" for number in itertools.count(2)))
        return next(name for name in names if not (self.folder / f"{name}.mcap").exists())

    def _attached(self) -> Iterator[tuple[str, bytes]]:
        for name, content in self._attachments.items():
            try:
                yield name, content()
            except QuadlabError as error:  # not reason enough to lose the ticks
                self._say(WARN, f"onboard log without {name}: {error}")

    def _add_ticks(self, batch: Batch) -> None:
        """Add queued ticks to the file. Raises StorageError."""
        if self._file is None or not len(batch.ticks):
            return
        stamps = batch.ticks["imu"]["stamp_ns"]
        if self._check_space(int(stamps[-1])):
            if not self._file.is_in_place():
                self._finish()
                if self._disarmed_ns:
                    return
                self._start(int(stamps[0]))
            self._file.check()
        self._file.add_ticks(batch)

    def _check_space(self, now_ns: int) -> bool:
        """Check the free space once a second; return whether it did. Raises StorageError."""
        if 0 <= now_ns - self._checked_ns < CHECK_NS:
            return False
        self._checked_ns = now_ns
        with os_errors(lambda why: f"cannot use {self.folder}: {why}"):
            self.folder.mkdir(parents=True, exist_ok=True)
            free = self._free(self.folder)
        least = self.stop_bytes
        if free < least:
            raise StorageError(
                f"{free // 10**6} MB free in {self.folder}, needs {least // 10**6} MB "
                "(log.stop_free); delete old runs"
            )
        return True

    def _stop(self, reason: str) -> None:
        self._say(ERROR, f"onboard log stopped: {reason}")
        self.problem = reason
        self._stopped = True
        self._checked_ns = 0
        self._finish()

    def _finish(self) -> None:
        file, self._file = self._file, None
        if file is None:
            return
        self._tidy_due = True
        in_place, torn = file.is_in_place(), ""
        try:
            file.close()
        except StorageError as error:
            torn = str(error)
        if not in_place:
            gone = f"{file.path} was removed, moved or replaced while it was written"
            self._say(ERROR, f"onboard log stopped: {gone}")
            self.problem = self.problem or gone
        elif torn:
            self.repair.note_torn()
            self._say(ERROR, f"onboard log not closed; it {self.repair.state}: {torn}")
        else:
            megabytes = file.size / 1e6
            self._say(INFO, f"onboard log {file.path.name} closed, {megabytes:.1f} MB")

    def _tidy(self) -> None:
        self._tidy_due = False
        try:
            for line in self._ring.tidy(self._limits()):
                self._say(INFO, line)
        except StorageError as error:
            self._say(WARN, str(error))
