"""The file of the run that is being recorded."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

from console.runs.run import RESTART_RESERVE, Run, RunEnd
from flight_log.writer import LogWriter
from quadrotor.errors import StorageError
from vehicle_link.clock import monotonic

CHUNK_AGE_NS = 10_000_000
"""Age in ns at which a chunk is closed. It is less than the pause of the recorder's thread (20 ms),
which so closes a chunk whenever it wakes: a killed process loses some 20 ms."""


class RunFile:
    """The file of a run being recorded; all but `sync` is for one thread. The attachments are
    requested here and may wait.

    Raises StorageError.
    """

    def __init__(self, run: Run) -> None:
        self.run = run
        attachments = run.attachments()
        try:
            self.writer = LogWriter(run.path, run.metadata, attachments, chunk_age_ns=CHUNK_AGE_NS)
        except StorageError:
            with suppress(OSError):  # not created, or it contains other files
                run.path.parent.rmdir()
            raise
        self.synced, self._since = time.monotonic(), monotonic()
        self.sync_problem: StorageError | None = None

    def sync(self) -> None:
        """Flush in a separate thread, because a disk under load may need a second. Errors are
        stored in `sync_problem`.
        """
        try:
            self.writer.sync()
        except StorageError as error:
            self.sync_problem = error

    def problem(self, folder: Path, free: int) -> StorageError | None:
        """Return why the run must end, with `free` bytes on the disk of `folder`; None when it may
        continue.
        """
        if not self.writer.is_in_place():
            return StorageError(f"{self.run.path} was removed or its folder has vanished")
        if free < self.run.keep_free:
            return StorageError(
                f"only {free // 10**6} MB are free in {folder}, "
                f"{self.run.keep_free // 10**6} MB are kept; delete or move runs: while armed, "
                f"the next begins with {(self.run.keep_free + RESTART_RESERVE) // 10**6} MB"
            )
        return None

    def close(self) -> bool:
        """Close the file, and return whether it has its index and is still where it was created.
        Raises StorageError.
        """
        in_place = self.writer.is_in_place()
        return self.writer.close() and in_place

    def end(self, *, dropped: int, closed: bool, problem: str) -> RunEnd:
        """Return the description of the run's end."""
        return RunEnd(
            run=self.run,
            duration=monotonic() - self._since,
            bytes=self.writer.size,
            messages=self.writer.message_count,
            dropped=dropped,
            closed=closed,
            problem=problem,
        )
