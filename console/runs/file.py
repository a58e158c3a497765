"""The file of the run that is being recorded."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

from console.runs.run import AGAIN_SPARE, Run, RunEnd
from flight_log import LogWriter
from quadrotor.errors import StorageError
from vehicle_link.clock import monotonic

CHUNK_AGE_NS = 10_000_000
"""Less than the recorder's thread pauses (20 ms), so that it closes a chunk whenever it wakes: a
killed process loses some 20 ms."""


class RunFile:
    """The file of a run being recorded, used by one thread, but for `sync`. The attachments are
    asked for here and may wait.

    Raises StorageError.
    """

    def __init__(self, run: Run) -> None:
        self.run = run
        attachments = run.attachments()
        try:
            self.writer = LogWriter(run.path, run.metadata, attachments, chunk_age_ns=CHUNK_AGE_NS)
        except StorageError:
            with suppress(OSError):  # not made, or others' files are in it
                run.path.parent.rmdir()
            raise
        self.synced, self._since = time.monotonic(), monotonic()
        self.sync_problem: StorageError | None = None

    def sync(self) -> None:
        """Flush in a thread of its own, as a disk under load may take a second; errors go to
        `sync_problem`.
        """
        try:
            self.writer.sync()
        except StorageError as error:
            self.sync_problem = error

    def problem(self, folder: Path, free: int) -> StorageError | None:
        """Return why the run must not go on, with `free` bytes on the disk of `folder`."""
        if not self.writer.is_in_place():
            return StorageError(f"{self.run.path} was removed or its folder has vanished")
        if free < self.run.keep_free:
            return StorageError(
                f"only {free // 10**6} MB are free in {folder}, "
                f"{self.run.keep_free // 10**6} MB are kept; delete or move runs: while armed, "
                f"the next begins with {(self.run.keep_free + AGAIN_SPARE) // 10**6} MB"
            )
        return None

    def close(self) -> bool:
        """Close, and return whether the run has its index and is still where it was begun. Raises
        StorageError.
        """
        in_place = self.writer.is_in_place()
        return self.writer.close() and in_place

    def end(self, *, dropped: int, closed: bool, problem: str) -> RunEnd:
        """Return how the run ended."""
        return RunEnd(
            run=self.run,
            duration=monotonic() - self._since,
            bytes=self.writer.size,
            messages=self.writer.message_count,
            dropped=dropped,
            closed=closed,
            problem=problem,
        )
