"""Repair of torn onboard logs while the vehicle is disarmed and its disk has room.

It runs in a process of the lowest priority, which is stopped when the vehicle is armed: reading a
long flight takes minutes of processor time. Logs of a killed vehicle are also repaired at its next
start (vehicle.onboard_log.repair); here failed repairs, usually for lack of room, are tried
again.
"""

from __future__ import annotations

import math
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from flight_log.file import is_being_written
from flight_log.index import holds_nothing, is_closed
from flight_log.recovery import recover
from quadrotor.errors import JobError, QuadlabError, StorageError
from vehicle.mailbox import INFO, WARN
from vehicle_link.jobs import IDLE, Job

FOLDER = "onboard"
"""Name of the folder in the data folder."""


def torn_logs(data: Path) -> list[Path]:
    """Return the onboard logs that were never closed. Raises StorageError."""
    folder = data / FOLDER
    return [path for path in sorted(folder.glob("*.mcap")) if not is_closed(path)]


def recover_logs(paths: list[Path]) -> Iterator[str]:
    """Repair each file and yield one line for it. A file that cannot be repaired is unchanged."""
    for path in paths:
        try:
            if holds_nothing(path) and not is_being_written(path):
                path.unlink()
                yield f"onboard log {path.name} removed: it holds nothing, its writer was killed"
                continue
            found = recover(path)
        except (QuadlabError, OSError) as error:
            yield f"onboard log {path.name} not recovered: {error}"
        else:
            if found.torn:
                yield f"onboard log {path.name} recovered: {found.messages} messages"


def repair_logs(paths: list[Path], report: Callable[[str], None]) -> None:
    """Repair logs in a separate process; SIGTERM leaves a torn file unchanged."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    for line in recover_logs(paths):
        report(line)


FIRST_S = 60.0
"""Delay, in s, from the first tick on the ground: the parent repairs the logs of the start first.
"""
PERIOD_S = 10.0
"""Time, in s, between two checks of the disk's room, and after the first try; then it doubles."""
TRIES = 8
"""Largest number of tries for one list of torn files; the last comes 20 min after the first."""
PATIENCE_S = 1.0

LATER = "is repaired at the vehicle's next start"
SOON = "is repaired once the vehicle is disarmed"
NOW = "is being repaired"


def start_repair(paths: Sequence[Path], report: Callable[[str], None]) -> Job[None]:
    """Start a process that repairs these files and reports a line for each."""
    return Job(repair_logs, list(paths), niceness=IDLE, report=report)


class LogRepair:
    """Repair of torn logs, driven by the onboard log's thread.

    Args:
        data: the data folder.
        say: called with (level, text) of an event.
        free: returns the free space of a folder, in bytes.
        keep: returns the bytes that must stay free next to the copy, to log the next flight.
        clock: s, steady.
        begin: starts a process for these files, which reports each.

    Attributes:
        state: when a torn log is repaired, in words that follow its name; from any thread.
    """

    def __init__(
        self,
        data: Path,
        say: Callable[[int, str], None],
        free: Callable[[Path], int],
        keep: Callable[[], int],
        clock: Callable[[], float] = time.monotonic,
        begin: Callable[[Sequence[Path], Callable[[str], None]], Job[None]] = start_repair,
    ) -> None:
        self.state = SOON
        self._data = data.absolute()
        self._say, self._free, self._keep = say, free, keep
        self._clock, self._begin = clock, begin
        self._process: Job[None] | None = None
        self._torn: list[Path] = []
        self._due_s: float | None = None
        self._cut = False  # by arming
        self._tries = 0
        self._reported: set[str] = set()

    def note_torn(self) -> None:
        """Note that a file could not be closed."""
        self._due_s, self._tries, self.state = self._clock(), 0, SOON

    def step(self, on_ground: bool) -> list[Path]:
        """Start, stop or check the repair without waiting; return the files repaired or removed."""
        if self._process is not None:
            return self._check_process(self._process, on_ground)
        if not on_ground:
            return []
        now_s = self._clock()
        if self._due_s is None:
            self._due_s = now_s + FIRST_S
        if now_s >= self._due_s:
            self._try(now_s)
        return []

    def close(self) -> None:
        """Stop the process; files that it has not finished stay unchanged."""
        process, self._process = self._process, None
        if process is not None:
            process.stop(PATIENCE_S)

    def _try(self, now_s: float) -> None:
        self._due_s = now_s + PERIOD_S
        try:
            self._torn = torn_logs(self._data)
            if not self._torn:
                self._due_s = math.inf
                return
            need = max(path.stat().st_size for path in self._torn) + self._keep()
            free = self._free(self._data)
        except (StorageError, OSError):  # removed meanwhile, or a disk error that the log reports
            return
        if free < need:
            self.state = (
                f"is repaired once {need // 10**6} MB are free on the vehicle's disk "
                f"({free // 10**6} MB are: delete old runs there)"
            )
            return
        if self._tries >= TRIES:
            self.state, self._due_s = LATER, math.inf
            return
        try:
            self._process, self._cut = self._begin(self._torn, self._report), False
        except JobError:  # not enough memory or processes: try later
            return
        self.state = NOW

    def _report(self, line: str) -> None:
        if line not in self._reported:
            self._say(WARN if " not recovered: " in line else INFO, line)
            self._reported.add(line)

    def _check_process(self, process: Job[None], on_ground: bool) -> list[Path]:
        if not process.poll():
            if not on_ground and not self._cut:
                process.terminate()
                self._cut, self.state = True, SOON
            return []
        self._process = None
        self._tries += not self._cut
        self._due_s = self._clock() + PERIOD_S * 2 ** max(0, self._tries - 1)
        self.state = SOON
        try:
            still = set(torn_logs(self._data))
        except StorageError:
            return []
        return [path for path in self._torn if path not in still]
