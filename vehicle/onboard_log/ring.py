"""The ring of onboard logs: the oldest are removed when they are too old or the disk is too full.

Logs that are not closed, that were just being fetched, or that are the newest are never removed.
"""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from flight_log.index import is_closed
from quadrotor.errors import StorageError, os_errors
from vehicle.onboard_log.parameters import OnboardLogParameters
from vehicle_link.machine_checks import kernel_clock

FETCHED_S = 300.0
"""Time, in s, for which a log is kept after it was read: the station may be fetching it."""
DAY_S = 86_400.0
CLOCK_SET_S = 1_577_836_800.0
"""Start of 2020, in s since the epoch: logs from before then were written with a clock that was not
set, so their age is unknown."""


def free_bytes(folder: Path) -> int:
    """Return the free bytes on the disk of `folder`. Raises OSError."""
    return shutil.disk_usage(folder).free


def is_clock_right() -> bool:
    """Return whether the kernel reports its clock as synchronised."""
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
    """Ring of logs in a folder.

    Args:
        fetched: tracks which files the station reads.
        free: returns the free space of a folder, in bytes.
        now: s since the epoch.
        clock_right: returns whether the clock is synchronised.
    """

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
        with os_errors(lambda why: f"cannot tidy {self._folder}: {why}"):
            logs = self._logs()
            total = sum(log.size for log in logs)
            for log in self._removable(logs[:-1]):
                if why := self._reason(log, total, keep):
                    log.path.unlink()
                    total -= log.size
                    yield f"onboard log {log.path.name} ({_size(log.size)}) removed: {why}"

    def _logs(self) -> list[_Log]:
        """Return the logs, oldest first."""
        found = []
        for path in self._folder.glob("*.mcap"):
            try:
                stat = path.stat()
            except FileNotFoundError:  # just repaired or removed
                continue
            found.append(_Log(path, stat.st_size, stat.st_mtime))
        return sorted(found, key=lambda log: (log.written, log.path.name))

    def _removable(self, logs: list[_Log]) -> Iterator[_Log]:
        for log in logs:
            try:
                if not self._fetched.lately(log.path.name) and is_closed(log.path):
                    yield log
            except StorageError:  # missing
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
