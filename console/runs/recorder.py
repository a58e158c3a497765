"""The recorder: a bounded queue and one thread that owns the run's file.

A caller of `put` never waits for the disk. Messages that do not fit are counted and reported; a
full disk, a missing folder or a failing file ends the run with an alarm, never the station.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from console.disk_worker import DiskWorker
from console.runs.disk import check_folder, free_bytes, recreate_folder, try_disk
from console.runs.file import RunFile
from console.runs.run import RESTART_RESERVE, RecorderStatus, Run, RunEnd
from quadrotor.errors import QuadlabError, StorageError
from vehicle_link.clock import monotonic

log = logging.getLogger(__name__)

QUEUE_LIMIT = 20_000
"""Maximum number of queued messages: 10 s at the full rate, some 15 MB."""

PERIOD = 0.02
AT_ONCE = 1000
"""Maximum number of messages written together: a chunk may exceed its size by all of them."""
SYNC_PERIOD = 0.25
WATCH_PERIOD = 1.0
RESTART_PERIOD = 3.0
"""Seconds between checks whether a run that the disk ended may have a successor."""

Message = tuple[str, str, bytes, int, int]
"""Topic, type name, CDR payload, log_ns, publish_ns."""


class Recorder:
    """Records runs; start, put and stop may be called from any thread.

    Args:
        folder: where runs are written; watched also while nothing is recorded.
        on_start, on_end: called in a thread next to the recorder's (catalogue), because a commit
            may take a second; StorageError becomes an alarm.
        on_restart: called in that thread some seconds after the disk ended a run, or prevented one,
            and repeatedly until one begins; it decides whether to begin one.
        on_watch: called once a second; returns what is wrong with the data folder, or "".
        queue_limit: number of messages that may wait for the disk.
        period: s between two writes.
    """

    def __init__(
        self,
        folder: Path,
        on_start: Callable[[Run], None] = lambda run: None,
        on_end: Callable[[RunEnd], None] = lambda end: None,
        queue_limit: int = QUEUE_LIMIT,
        on_restart: Callable[[], None] = lambda: None,
        on_watch: Callable[[], str] = lambda: "",
        period: float = PERIOD,
    ) -> None:
        self._folder = folder
        self._on_start, self._on_end, self._on_restart = on_start, on_end, on_restart
        self._on_watch = on_watch
        self._limit = queue_limit
        self._queue: deque[Message | Run | None] = deque()  # None: stop
        self._wake = threading.Event()
        self._idle = threading.Event()
        self._idle.set()
        self._closing = False
        self._current: Run | None = None
        self._open: RunFile | None = None
        self._since = 0.0
        self._bytes = 0
        self._dropped: Counter[str] = Counter()  # by run
        self._free = 0
        self._alarms: dict[str, str] = {}
        self._needs_restart = False  # the disk ended a run, and none has begun since
        self._requested_at = 0.0
        self._lock = threading.Lock()
        self._worker = DiskWorker("recorder-disk", self._update_idle)
        self._period = period
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    @property
    def run_id(self) -> str:
        """Return the id of the run being recorded, or ""."""
        run = self._current
        return run.run_id if run else ""

    def start(self, run: Run, *, again: bool = False) -> None:
        """Begin a recording; messages put from now on belong to the run.

        Args:
            again: whether the disk ended the previous run. Then RESTART_RESERVE more free space and
                a successful test write are required; until then the alarm of that end stays.

        Raises StorageError when a run is being recorded, the folder is not writable or the disk is
        too full.
        """
        try:
            # Outside the lock: a disk that does not answer must not delay `stop`.
            check_folder(self._folder, run.keep_free + again * RESTART_RESERVE)
            if again:
                try_disk(self._folder)
        except StorageError as error:
            if not again:
                self._alarms["run"] = str(error)
                self._needs_restart = True
            raise
        with self._lock:
            if self._current is not None:
                raise StorageError(f"run {self._current.run_id} is being recorded; stop it first")
            if self._closing or not self._thread.is_alive():
                raise StorageError("the recorder has stopped; start the station again")
            self._alarms.pop("run", None)
            self._alarms.pop("dropped", None)
            self._needs_restart = False
            self._idle.clear()
            self._bytes = 0
            self._since = monotonic()
            self._queue.append(run)
            self._current = run
        self._wake.set()

    def put(self, topic: str, type_name: str, payload: bytes, log_ns: int, publish_ns: int) -> None:
        """Queue one message; discarded while nothing is recorded. Never waits."""
        self.put_all(((topic, type_name, payload, log_ns, publish_ns),))

    def put_all(self, messages: Sequence[Message]) -> None:
        """Queue several messages, as `put` does."""
        if self._current is None:
            return
        if len(self._queue) + len(messages) > self._limit:
            run_id = self.run_id
            self._dropped[run_id] += len(messages)
            self._alarms["dropped"] = (
                f"recorder: {self._dropped[run_id]} messages of run {run_id} were dropped; "
                "the disk is slower than the data"
            )
            return
        self._queue.extend(messages)

    def stop(self) -> None:
        """End the run after all queued messages; without a run nothing happens."""
        with self._lock:
            if self._current is None:
                return
            self._current = None
            self._queue.append(None)
        self._wake.set()

    def wait_idle(self, timeout: float) -> bool:
        """Wait until no file is open, at most `timeout` s; return whether that is so."""
        return self._idle.wait(timeout)

    def close(self, timeout: float = 30.0) -> None:
        """Stop, write all queued messages, close the file, end the thread."""
        self._closing = True  # first, so that no run begins any more
        self.stop()
        self._wake.set()
        self._thread.join(timeout)
        self._worker.close(timeout)

    def status(self) -> RecorderStatus:
        run = self._current
        return RecorderStatus(
            recording=run is not None,
            run_id=run.run_id if run else "",
            duration=monotonic() - self._since if run else 0.0,
            bytes=self._bytes,
            free_bytes=self._free,
            dropped=self._dropped[run.run_id] if run else 0,
            alarms=tuple(self._alarms.copy().values()),
        )

    # The following methods run in the recorder's thread.

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
                # Polled while recording, so that `put` does not pay for waking this thread.
                self._wake.wait(self._period if self._open else WATCH_PERIOD)
                self._wake.clear()
        except BaseException as error:
            self._alarms["run"] = f"recorder: stopped by a defect, see the station's log: {error!r}"
            self._current = None
            self._idle.set()
            log.exception("recorder stopped")
            raise

    def _drain(self) -> None:
        queue, messages = self._queue, list[Message]()
        while queue:
            item = queue.popleft()
            if isinstance(item, tuple):
                messages.append(item)
                if len(messages) < AT_ONCE:
                    continue
            self._write(messages)
            messages.clear()
            if item is None:
                self._end("")
            elif not isinstance(item, tuple):
                self._begin(item)
        self._write(messages)
        if self._open is not None:
            self._bytes = self._open.writer.size
        self._update_idle()

    def _write(self, messages: list[Message]) -> None:
        if self._open is not None:
            try:
                self._open.writer.write_many(messages)
            except Exception as error:
                self._fail(self._open.run, error)

    def _begin(self, run: Run) -> None:
        try:
            self._open = RunFile(run)
        except Exception as error:
            self._fail(run, error)
        else:
            self._worker.put(partial(self._notify, self._on_start, run))

    def _end(self, problem: str) -> None:
        if self._open is None:
            return
        done, closed = self._open, False
        try:
            closed = done.close()
        except Exception as error:
            line = _error_line(error)
            problem = problem or line
            self._alarms["run"] = f"recording stopped: {line}"
        self._bytes = done.writer.size
        dropped = self._dropped.pop(done.run.run_id, 0)
        end = done.end(dropped=dropped, closed=closed, problem=problem)
        self._worker.put(partial(self._notify, self._on_end, end))
        self._open = None

    def _notify(self, callback: Callable[[Any], None], what: Run | RunEnd) -> None:
        """Report to the catalogue; the file matters more than its entry there."""
        try:
            callback(what)
            self._alarms.pop("catalogue", None)
        except Exception as error:
            self._alarms["catalogue"] = _error_line(error)

    def _fail(self, run: Run, error: Exception) -> None:
        """End a run that cannot continue: raise the alarm, close its file, and skip its queued
        messages.
        """
        line = _error_line(error)
        with self._lock:
            self._alarms["run"] = f"recording stopped: {line}"
            if self._current is run:
                self._current = None
                self._needs_restart = isinstance(error, StorageError)
                self._requested_at = time.monotonic()
        self._end(line)
        self._update_idle()

    def _update_idle(self) -> None:
        with self._lock:
            is_done = self._current is None and self._open is None and not self._queue
            if is_done and self._worker.is_idle:
                self._idle.set()

    def _sync(self) -> None:
        """Write pending data into the file several times a second, and flush it to the disk."""
        file, now = self._open, time.monotonic()
        if file is None or now - file.synced < SYNC_PERIOD:
            return
        file.synced = now
        try:
            if file.sync_problem is not None:
                raise file.sync_problem
            file.writer.close_chunk()
        except Exception as error:
            self._fail(file.run, error)
            return
        if self._worker.is_idle:
            self._worker.put(file.sync)

    def _watch(self) -> None:
        """Check once a second whether the disk of the folder still exists."""
        problem = self._on_watch()
        if not problem:
            recreate_folder(self._folder)
        try:
            self._free = free_bytes(self._folder)
        except StorageError as error:
            self._free = 0
            problem = problem or self._on_watch() or str(error)  # lost since the first check
        if problem:
            self._alarms["folder"] = problem
        else:
            self._alarms.pop("folder", None)
        if self._open is not None:
            failure = self._open.problem(self._folder, self._free)
            if failure is not None:
                self._fail(self._open.run, failure)
        self._request_restart()

    def _request_restart(self) -> None:
        """Call `on_restart` in another thread: it accesses the disk, which may take long."""
        now = time.monotonic()
        is_due = self._needs_restart and now - self._requested_at >= RESTART_PERIOD
        if is_due and self._worker.is_idle:
            self._requested_at = now
            self._worker.put(self._on_restart)


def _error_line(error: Exception) -> str:
    """Return the error as one line; a defect must end one run, not all that follow."""
    if isinstance(error, QuadlabError):
        return str(error)
    log.exception("recorder")
    return f"a defect, see the station's log: {error!r}"
