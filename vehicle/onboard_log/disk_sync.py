"""A thread that flushes a log to the disk once a second, to limit the loss by a power cut.

It has its own file descriptor, so that a slow disk does not block the writers.
"""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

from flight_log.file import sync_folder

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
