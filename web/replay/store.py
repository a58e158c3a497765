"""The replays' caches: built when first asked for, one at a time, and of bounded size together.

They lie in `runs/.replay/`, one folder a log (console.runs.replay_caches), and belong to a log's
size and time of change: when it grows or is mended, they are built again.
"""

from __future__ import annotations

import json
import os
import shutil
import threading
from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path

from console.runs.replay_caches import REPLAYS, replay_name
from flight_log.columns import folder_bytes
from flight_log.file import is_being_written
from flight_log.run_folder import log_of
from quadrotor.errors import JobError, LogFormatError, QuadlabError, RefusedError, StorageError
from vehicle_link.jobs import run
from web.replay.build import build_cache
from web.replay.cache_writer import VERSION
from web.replay.reader import Replay

LARGEST = 4_000_000_000
"""Bytes of all caches together, with the one on its way; those looked at longest ago go first."""
MOST_OPEN = 6
WAITING = 20
"""Replays that may wait for their turn: each has a thread."""
STAMP = "stamp.json"
ON_ITS_WAY = ".new"
LOOK = 0.01
"""Of the progress, between two looks at how large it has become."""
NICENESS = 10
"""Below everything that flies; somebody waits for it all the same."""


@dataclass
class Building:
    """A cache on its way."""

    progress: float = 0.0  # 0 to 1
    problem: str = ""
    stamp: tuple[int, int] = (0, 0)


class ReplayStore:
    """Thread-safe. Args: the folder of the runs."""

    def __init__(self, runs: Path) -> None:
        self._runs = runs
        self._folder = runs / REPLAYS
        self._lock = threading.Lock()
        self._one_at_a_time = threading.Lock()
        self._building: dict[str, Building] = {}
        self._open: OrderedDict[str, tuple[tuple[int, int], Replay]] = OrderedDict()

    def get(self, log: Path, *, newer: bool = False) -> Replay | Building:
        """Return the replay of a log, or how far it is.

        A recording that still grows is shown as it was when it was opened; `newer` asks for what
        has come since. Raises StorageError or LogFormatError with the reason a log has none,
        RefusedError while too many wait.
        """
        stamp = _stamp(log)
        name = self._name(log)
        with self._lock:
            building = self._building.get(name)
            if building is not None and building.problem:
                del self._building[name]
                if building.stamp == stamp:
                    raise LogFormatError(building.problem)
            elif building is not None:
                return building
            kept = self._kept(name)
            if kept is not None:
                is_current = kept[0] == stamp
                if is_current or (not newer and is_being_written(log)):
                    return kept[1]
            if sum(not one.problem for one in self._building.values()) >= WAITING:
                raise RefusedError(f"{WAITING} replays wait already; try again in some minutes")
            building = self._building[name] = Building(stamp=stamp)
        threading.Thread(
            target=self._build, args=(log, building), name="replay-build", daemon=True
        ).start()
        return building

    def opened(self, log: Path) -> Replay:
        """Return a replay that `get` gave before. Raises StorageError when it does not exist (any
        more).
        """
        with self._lock:
            kept = self._kept(self._name(log))
        if kept is None:
            raise StorageError(f"the replay of {log.stem} is not ready; open its page again")
        return kept[1]

    def is_current(self, log: Path) -> bool:
        """Return whether the replay that is kept shows all of the log."""
        with self._lock:
            kept = self._kept(self._name(log))
        return kept is not None and kept[0] == _stamp(log)

    def _name(self, log: Path) -> str:
        return replay_name(log, self._runs)

    def _kept(self, name: str) -> tuple[tuple[int, int], Replay] | None:
        found = self._open.get(name)
        if found is None or not found[1].track.exists():  # it may have gone with its run
            self._open.pop(name, None)
            folder = self._folder / name
            try:
                fields = json.loads((folder / STAMP).read_text())
                stamp = (int(fields["bytes"]), int(fields["changed_ns"]))
                if fields["version"] != VERSION:
                    return None
                found = (stamp, Replay(folder))
            except (OSError, ValueError, KeyError, TypeError, StorageError):
                return None
            os.utime(folder / STAMP)
            self._open[name] = found
        self._open.move_to_end(name)
        while len(self._open) > MOST_OPEN:
            self._open.popitem(last=False)
        return found

    def _build(self, log: Path, building: Building) -> None:
        with self._one_at_a_time:
            problem = ""
            try:
                self._tidy(self._name(log))
                self._run(log, building)
                self._tidy(self._name(log))
            except JobError as error:
                problem = (
                    f"the replay of {log.stem} could not be built: {error}; "
                    "is there memory and room on the disk?"
                )
            except QuadlabError as error:
                problem = str(error)
            except Exception as error:  # else it would be on its way for ever
                problem = f"the replay of {log.stem} could not be built: {error!r}"
        with self._lock:
            self._open.pop(self._name(log), None)
            if problem:
                building.problem = problem
            else:
                del self._building[self._name(log)]

    def _run(self, log: Path, building: Building) -> None:
        name = self._name(log)
        new = self._folder / f"{name}{ON_ITS_WAY}"
        looked = -1.0

        def report(share: float) -> None:
            nonlocal looked
            building.progress = share
            if share >= looked + LOOK or share == 1.0:
                looked = share
                if not self._make_room(name):
                    raise StorageError(_too_large(log))

        try:
            run(build_cache, log, new, niceness=NICENESS, report=report)
        except QuadlabError:
            shutil.rmtree(new, ignore_errors=True)
            raise
        size, changed = building.stamp
        (new / STAMP).write_text(
            json.dumps({"version": VERSION, "bytes": size, "changed_ns": changed, "log": str(log)})
        )
        shutil.rmtree(self._folder / name, ignore_errors=True)
        new.rename(self._folder / name)

    def _tidy(self, name: str) -> None:
        """Remove caches whose log is gone, what a crash has left, and the oldest above LARGEST.

        Args:
            name: of the cache that stays.
        """
        for folder in self._folder.glob("*"):
            if not _is_wanted(folder, self._runs):
                shutil.rmtree(folder, ignore_errors=True)
        self._make_room(name)

    def _make_room(self, name: str) -> bool:
        """Remove the oldest caches above LARGEST, but not `name`; return whether that was
        enough.
        """
        excess = folder_bytes(self._folder) - LARGEST
        if excess <= 0:
            return True
        mine = (name, f"{name}{ON_ITS_WAY}")
        stamps = [one for one in self._folder.glob(f"*/{STAMP}") if one.parent.name not in mine]
        for stamp in sorted(stamps, key=lambda one: one.stat().st_mtime):
            if excess <= 0:
                break
            excess -= folder_bytes(stamp.parent)
            shutil.rmtree(stamp.parent, ignore_errors=True)
        return excess <= 0


def _is_wanted(folder: Path, runs: Path) -> bool:
    """Return whether the replay can still be shown: its log exists, and no crash has damaged it."""
    try:
        fields = json.loads((folder / STAMP).read_text())
        log = Path(fields["log"])
        is_found_again = folder.name == replay_name(log, runs) and fields["version"] == VERSION
        return is_found_again and log.exists()
    except (OSError, ValueError, KeyError, TypeError):
        return False


def _too_large(log: Path) -> str:
    return (
        f"the replay of {log.stem} would take more than {LARGEST / 1e9:g} GB; "
        "download the log and open it in another program"
    )


def _stamp(log: Path) -> tuple[int, int]:
    try:
        status = log_of(log).stat()
    except OSError as error:
        raise StorageError(f"cannot read {log.name}: {error.strerror}") from error
    return status.st_size, status.st_mtime_ns
