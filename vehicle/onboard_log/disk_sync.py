"""A thread that sends what was written of a log to the disk itself once a second: a power cut takes
no more.

In a thread of its own, through a descriptor of its own: a slow disk holds up no one who writes.
"""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

from flight_log.file import sync_folder

PERIOD_S = 1.0


class DiskSync:
    """A thread that flushes one file to the disk, from now until `end`.

    Attributes:
        problem: why something did not reach the disk, in words.
        count, slowest: times it was sent, and the longest, s.
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
        """End soon; who closes the file sends the rest."""
        self._ended.set()

    def _run(self) -> None:
        try:
            file = os.open(self.path, os.O_RDONLY | os.O_CLOEXEC)
            try:
                sync_folder(self.path.parent)  # its name, too
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
