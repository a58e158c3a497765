"""The ring of onboard logs: the oldest go when they are too old, too many, or the disk too full.

Never one that is not closed, never the newest, and never one that was just being fetched.
"""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from flight_log import is_closed
from quadrotor.errors import StorageError
from vehicle.onboard_log.parameters import OnboardLogParameters
from vehicle_link.machine_checks import kernel_clock

FETCHED_S = 300.0
"""A log that was read within is left: the station may be fetching it."""
DAY_S = 86_400.0
CLOCK_SET_S = 1_577_836_800.0
"""Logs from before 2020 were written by a clock that was not set: their age is not known."""


def free_bytes(folder: Path) -> int:
    """Return the free bytes on the disk of `folder`. Raises OSError."""
    return shutil.disk_usage(folder).free


def is_clock_right() -> bool:
    """Return whether the kernel calls its clock synchronised."""
    try:
        return kernel_clock()[0]
    except (OSError, AttributeError):
        return False


class Fetched:
    """The times at which logs were last read; from any thread."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._read: dict[str, float] = {}

    def note(self, name: str) -> None:
        with self._lock:
            self._read[name] = self._clock()

    def lately(self, name: str) -> bool:
        with self._lock:
            read = self._read.get(name)
        return read is not None and self._clock() - read < FETCHED_S


@dataclass(frozen=True, slots=True)
class _Log:
    path: Path
    size: int
    written: float  # s since the epoch


class Ring:
    """Args: the folder of the logs; `free`, `now` (s since the epoch) and `clock_right` of it."""

    def __init__(
        self,
        folder: Path,
        fetched: Fetched | None = None,
        free: Callable[[Path], int] = free_bytes,
        now: Callable[[], float] = time.time,
        clock_right: Callable[[], bool] = is_clock_right,
    ) -> None:
        self._folder, self._fetched = folder, fetched or Fetched()
        self._free, self._now, self._clock_right = free, now, clock_right

    def tidy(self, keep: OnboardLogParameters) -> Iterator[str]:
        """Remove the oldest logs that must go; return a line for each. Raises StorageError."""
        try:
            logs = self._logs()
            total = sum(log.size for log in logs)
            for log in self._removable(logs[:-1]):
                if why := self._reason(log, total, keep):
                    log.path.unlink()
                    total -= log.size
                    yield f"onboard log {log.path.name} ({_size(log.size)}) removed: {why}"
        except OSError as error:
            raise StorageError(f"cannot tidy {self._folder}: {error.strerror}") from error

    def _logs(self) -> list[_Log]:
        """Return the logs, oldest first."""
        found = []
        for path in self._folder.glob("*.mcap"):
            try:
                stat = path.stat()
            except FileNotFoundError:  # just mended or removed
                continue
            found.append(_Log(path, stat.st_size, stat.st_mtime))
        return sorted(found, key=lambda log: (log.written, log.path.name))

    def _removable(self, logs: list[_Log]) -> Iterator[_Log]:
        for log in logs:
            try:
                if not self._fetched.lately(log.path.name) and is_closed(log.path):
                    yield log
            except StorageError:  # gone
                continue

    def _reason(self, log: _Log, total: int, keep: OnboardLogParameters) -> str:
        free = self._free(self._folder)
        if free < 1e6 * keep.keep_free:
            return f"{_size(free)} free, log.keep_free is {_size(1e6 * keep.keep_free)}"
        if total > 1e9 * keep.keep_size:
            return f"all are {_size(total)}, log.keep_size is {_size(1e9 * keep.keep_size)}"
        age = (self._now() - log.written) / DAY_S
        if age > keep.keep_days and log.written > CLOCK_SET_S and self._clock_right():
            return f"{age:.0f} days old, log.keep_days is {keep.keep_days:g}"
        return ""


def _size(count: float) -> str:
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.1f} MB"
