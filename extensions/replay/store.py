"""Opened replays: prepared when first requested, one at a time.

The files of a replay are stored with the columns of its log (flight_log.columns), so that they are
made again when the log grows or is repaired, and are deleted with them.
"""

from __future__ import annotations

import shutil
import threading
from collections import OrderedDict
from dataclasses import dataclass, field
from pathlib import Path

from extensions.replay.build import build_replay
from extensions.replay.reader import Replay
from flight_log.columns.places import LARGEST, identity, make_room, place_of
from flight_log.file import is_being_written
from flight_log.run_folder import log_of
from quadrotor.errors import JobError, LogFormatError, QuadlabError, RefusedError, StorageError
from vehicle_link.jobs import run

MOST_OPEN = 16
"""Replays that stay open; the page that compares runs shows up to twelve."""
WAITING = 20
"""Replays that may wait for their turn; each has a thread."""
LOOK = 0.01
"""Share of the progress between two checks of the size of the columns."""
NICENESS = 10
"""Niceness below all that flies; not lower, because a person waits for it."""


@dataclass
class Building:
    """Replay that is being prepared."""

    progress: float = 0.0  # 0 to 1
    problem: str = ""
    identity: list[int] = field(default_factory=list)


class ReplayStore:
    """Opened replays of a page; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._one_at_a_time = threading.Lock()
        self._building: dict[Path, Building] = {}
        self._open: OrderedDict[Path, Replay] = OrderedDict()

    def get(self, log: Path, *, newer: bool = False) -> Replay | Building:
        """Return the replay of a log, or its progress while it is prepared.

        A recording that still grows is shown as it was when it was opened; `newer` includes what
        has been recorded since. Raises StorageError or LogFormatError with the reason why a log has
        none, RefusedError while too many wait.
        """
        now = identity(log_of(log))
        with self._lock:
            building = self._building.get(log)
            if building is not None and building.problem:
                del self._building[log]
                if building.identity == now:
                    raise LogFormatError(building.problem)
            elif building is not None:
                return building
            kept = self._kept(log)
            if kept is not None and (kept.identity == now or (not newer and is_being_written(log))):
                return kept
            if sum(not one.problem for one in self._building.values()) >= WAITING:
                raise RefusedError(
                    f"{WAITING} replays are queued already; try again in some minutes"
                )
            building = self._building[log] = Building(identity=now)
        threading.Thread(
            target=self._build, args=(log, building), name="replay-build", daemon=True
        ).start()
        return building

    def opened(self, log: Path) -> Replay:
        """Return a replay that `get` has returned before.

        Raises StorageError if it does not exist (any more).
        """
        with self._lock:
            kept = self._kept(log)
        if kept is None:
            raise StorageError(f"the replay of {log.stem} is not ready; open its page again")
        return kept

    def is_current(self, log: Path) -> bool:
        """Return whether the replay that is stored shows all of the log."""
        with self._lock:
            kept = self._kept(log)
        return kept is not None and kept.identity == identity(log_of(log))

    def _kept(self, log: Path) -> Replay | None:
        found = self._open.get(log)
        if found is None:
            try:
                found = self._open[log] = Replay(log)
            except (StorageError, LogFormatError):
                return None
        self._open.move_to_end(log)
        while len(self._open) > MOST_OPEN:
            self._open.popitem(last=False)
        return found

    def _build(self, log: Path, building: Building) -> None:
        with self._one_at_a_time:
            problem = ""
            try:
                self._run(log, building)
            except JobError as error:
                problem = (
                    f"the replay of {log.stem} could not be built: {error}; "
                    "is there enough memory and disk space?"
                )
            except QuadlabError as error:
                problem = str(error)
            except Exception as error:  # otherwise it would stay in preparation for ever
                problem = f"the replay of {log.stem} could not be built: {error!r}"
        with self._lock:
            self._open.pop(log, None)
            if problem:
                building.problem = problem
            else:
                del self._building[log]

    def _run(self, log: Path, building: Building) -> None:
        place = place_of(log_of(log))
        looked = -1.0

        def report(share: float) -> None:
            nonlocal looked
            building.progress = share
            if share >= looked + LOOK or share == 1.0:
                looked = share
                if not make_room(place.parent, place.name):
                    raise StorageError(
                        f"the replay of {log.stem} would take more than {LARGEST / 1e9:g} GB; "
                        "download the log and open it in another program"
                    )

        try:
            run(build_replay, log, niceness=NICENESS, report=report)
        except QuadlabError:
            if not make_room(place.parent, place.name):
                shutil.rmtree(place, ignore_errors=True)
            raise
