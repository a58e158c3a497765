"""The recorder: a bounded queue and one thread that owns the run's file.

Whoever puts a message never waits for the disk. What does not fit is counted and said; a full
disk, a vanished folder or a failing file ends the run with an alarm, never the station.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from console.disk import check_folder, free_bytes
from console.run import RecorderStatus, Run, RunEnd
from quadrotor.errors import StorageError
from vehicle_link.log import LogWriter

log = logging.getLogger(__name__)

QUEUE_LIMIT = 20_000
"""Messages: 10 s at the full rate, some 15 MB."""

PERIOD = 0.02
SYNC_PERIOD = 0.25
WATCH_PERIOD = 1.0

Message = tuple[str, str, bytes, int, int]
"""Topic, type name, CDR payload, log_ns, publish_ns."""


@dataclass
class _Open:
    """The run being written; owned by the thread."""

    run: Run
    writer: LogWriter
    since: float
    synced: float = 0.0


class Recorder:
    """Start, put, stop from any thread.

    Args:
        folder: where runs are written; watched also while nothing is recorded.
        on_start, on_end: called in the recorder's thread (catalogue); StorageError becomes an
            alarm.
        queue_limit: messages that may wait for the disk.
    """

    def __init__(
        self,
        folder: Path,
        on_start: Callable[[Run], None] = lambda run: None,
        on_end: Callable[[RunEnd], None] = lambda end: None,
        queue_limit: int = QUEUE_LIMIT,
    ) -> None:
        self._folder = folder
        self._on_start, self._on_end = on_start, on_end
        self._limit = queue_limit
        self._queue: deque[Message | Run | None] = deque()  # None: stop
        self._wake = threading.Event()
        self._idle = threading.Event()
        self._idle.set()
        self._closing = False
        self._wanted: Run | None = None
        self._open: _Open | None = None
        self._since = 0.0
        self._bytes = 0
        self._dropped = 0
        self._free = 0
        self._alarms: dict[str, str] = {}
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    @property
    def run_id(self) -> str:
        """Of the run being recorded, or empty."""
        run = self._wanted
        return run.run_id if run else ""

    def start(self, run: Run) -> None:
        """Begin; messages put from now on belong to the run.

        Raises StorageError when a run is being recorded, the folder is not writable or the disk
        is too full.
        """
        with self._lock:
            if self._wanted is not None:
                raise StorageError(f"run {self._wanted.run_id} is being recorded; stop it first")
            try:
                check_folder(run.path.parent, run.keep_free)
            except StorageError as error:
                self._alarms["run"] = str(error)
                raise
            self._alarms.pop("run", None)
            self._alarms.pop("dropped", None)
            self._idle.clear()
            self._dropped = 0
            self._bytes = 0
            self._since = time.monotonic()
            self._queue.append(run)
            self._wanted = run
        self._wake.set()

    def put(self, topic: str, type_name: str, payload: bytes, log_ns: int, publish_ns: int) -> None:
        """One message; forgotten when nothing is recorded. Never waits."""
        self.put_all(((topic, type_name, payload, log_ns, publish_ns),))

    def put_all(self, messages: Sequence[Message]) -> None:
        """As `put`, for several."""
        if self._wanted is None:
            return
        if len(self._queue) + len(messages) > self._limit:
            self._dropped += len(messages)
            self._alarms["dropped"] = (
                f"recorder: {self._dropped} messages of run {self.run_id} were dropped; "
                "the disk is slower than the data"
            )
            return
        self._queue.extend(messages)

    def stop(self) -> None:
        """End the run after what was put so far; without a run nothing happens."""
        with self._lock:
            if self._wanted is None:
                return
            self._wanted = None
            self._queue.append(None)
        self._wake.set()

    def wait_idle(self, timeout: float) -> bool:
        """True when no file is open any more within `timeout` s."""
        return self._idle.wait(timeout)

    def close(self, timeout: float = 30.0) -> None:
        """Stop, write what waits, close the file, end the thread."""
        self.stop()
        self._closing = True
        self._wake.set()
        self._thread.join(timeout)

    def status(self) -> RecorderStatus:
        run = self._wanted
        return RecorderStatus(
            recording=run is not None,
            run_id=run.run_id if run else "",
            duration=time.monotonic() - self._since if run else 0.0,
            bytes=self._bytes,
            free_bytes=self._free,
            dropped=self._dropped,
            alarms=tuple(self._alarms.copy().values()),
        )

    # What follows runs in the recorder's thread.

    def _run(self) -> None:
        watched = -WATCH_PERIOD
        try:
            while True:
                closing = self._closing
                self._drain()
                now = time.monotonic()
                if now - watched >= WATCH_PERIOD:
                    watched = now
                    self._watch()
                self._sync()
                if closing and self._open is None and not self._queue:
                    return
                # Polled while recording, so that nobody who puts pays for waking us.
                self._wake.wait(PERIOD if self._open else WATCH_PERIOD)
                self._wake.clear()
        except Exception as error:
            self._alarms["run"] = f"recorder: stopped by a defect, see the station's log: {error!r}"
            self._wanted = None
            self._idle.set()
            log.exception("recorder stopped")
            raise

    def _drain(self) -> None:
        queue = self._queue
        while queue:
            item = queue.popleft()
            if isinstance(item, tuple):
                if self._open is not None:
                    try:
                        self._open.writer.write(*item)
                    except StorageError as error:
                        self._fail(self._open.run, error)
            elif item is None:
                self._end("")
            else:
                self._begin(item)
        if self._open is not None:
            self._bytes = self._open.writer.size
        self._rest()

    def _begin(self, run: Run) -> None:
        try:
            writer = LogWriter(run.path, run.metadata, run.attachments())
        except StorageError as error:
            self._fail(run, error)
            return
        self._open = _Open(run, writer, time.monotonic())
        try:
            self._on_start(run)
            self._alarms.pop("catalogue", None)
        except StorageError as error:  # the file matters more than its line in the catalogue
            self._alarms["catalogue"] = str(error)

    def _end(self, problem: str) -> None:
        if self._open is None:
            return
        done, self._open = self._open, None
        closed = False
        try:
            in_place = done.writer.is_in_place()
            closed = done.writer.close() and in_place
        except StorageError as error:
            problem = problem or str(error)
            self._alarms["run"] = str(error)
        self._bytes = done.writer.size
        end = RunEnd(
            run=done.run,
            duration=time.monotonic() - done.since,
            bytes=done.writer.size,
            messages=done.writer.message_count,
            dropped=self._dropped,
            closed=closed,
            problem=problem,
        )
        try:
            self._on_end(end)
        except StorageError as error:
            self._alarms["catalogue"] = str(error)

    def _fail(self, run: Run, error: StorageError) -> None:
        """The run cannot go on: say so and close what there is; what waits for it is skipped."""
        with self._lock:
            self._alarms["run"] = f"recording stopped: {error}"
            if self._wanted is run:
                self._wanted = None
        self._end(str(error))
        self._rest()

    def _rest(self) -> None:
        with self._lock:
            if self._wanted is None and self._open is None and not self._queue:
                self._idle.set()

    def _sync(self) -> None:
        now = time.monotonic()
        if self._open is None or now - self._open.synced < SYNC_PERIOD:
            return
        self._open.synced = now
        try:
            self._open.writer.flush()
        except StorageError as error:
            self._fail(self._open.run, error)

    def _watch(self) -> None:
        """Once a second: is there still a disk below us?"""
        try:
            self._free = free_bytes(self._folder)
            self._alarms.pop("folder", None)
        except StorageError as error:
            self._free = 0
            self._alarms["folder"] = str(error)
        if self._open is None:
            return
        run = self._open.run
        if not self._open.writer.is_in_place():
            self._fail(run, StorageError(f"{run.path} was removed or its folder has vanished"))
        elif self._free < run.keep_free:
            self._fail(
                run,
                StorageError(
                    f"only {self._free // 10**6} MB are free in {self._folder}, "
                    f"{run.keep_free // 10**6} MB are kept; delete or move runs"
                ),
            )
