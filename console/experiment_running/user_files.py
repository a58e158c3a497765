"""Users' own experiments: files of a folder and modules of packages, checked in the background,
loaded when started.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterable
from pathlib import Path

from console.experiment_running.file_check import Described, check
from console.experiments.catalogue import experiments
from console.experiments.client import Experiment
from console.experiments.user_file import GROUP, load
from quadrotor.errors import QuadlabError, RefusedError, StorageError
from quadrotor.packaged_files import packaged_files

log = logging.getLogger(__name__)

FOLDER = "experiments"
"""Name of the folder below the data folder."""
PERIOD = 2.0
"""s between two scans of the folder."""
LOAD = 5.0
"""s for a file to load in the station, after a check in another process."""
FILES_MAX = 100

Version = tuple[int, int]
"""Time of the last change (ns) and size (bytes) of a file."""


class UserFiles:
    """Scans the folder in a separate thread; a missing folder counts as empty."""

    def __init__(self, folder: Path, vehicle: str) -> None:
        self._folder, self._vehicle = folder, vehicle
        self._packaged = packaged_files(GROUP).values()
        self._lock = threading.Lock()
        self._known: dict[Path, tuple[Version, Described]] = {}
        self._waiting: tuple[Path, ...] = ()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="experiment files", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closing.set()

    def described(self) -> list[Described]:
        """Return all files by name, including broken ones. Does not block."""
        with self._lock:
            known = {path: found for path, (_, found) in sorted(self._known.items())}
            waiting = self._waiting
        listed, taken = [], set(experiments())
        for path, found in known.items():
            if not found.problem and found.name in taken:
                problem = f"{path.name}: there is an experiment {found.name} already; rename it"
                listed.append(Described(path.name, problem=problem))
            else:
                listed.append(found)
            taken.add(found.name)
        return listed + [
            Described(path.name, problem=f"{path.name} is being checked; try again in a moment")
            for path in waiting
            if path not in known
        ]

    def find(self, name: str) -> Experiment | None:
        """Return a new experiment of this name; None when no file has it.

        Raises RefusedError for a broken file, StorageError or UsageError for one broken since.
        """
        found = next((one for one in self.described() if one.name == name), None)
        if found is None:
            return None
        if found.problem:
            raise RefusedError(f"{name} cannot run: {found.problem}")
        with self._lock:
            paths = [path for path, (_, one) in sorted(self._known.items()) if one.name == name]
        return self._loaded(paths[0]) if paths else None

    def _loaded(self, path: Path) -> Experiment:
        """Load a file in a separate thread, because the file may hang."""
        made: list[Experiment] = []
        failed: list[QuadlabError] = []

        def run() -> None:
            try:
                made.append(load(path, self._vehicle))
            except QuadlabError as error:
                failed.append(error)
            except BaseException as error:  # nothing in a user's file may harm the station
                failed.append(StorageError(f"{path.name} cannot be loaded: {error!r}"))

        thread = threading.Thread(target=run, name="experiment file", daemon=True)
        thread.start()
        thread.join(LOAD)
        if failed:
            raise failed[0]
        if not made:
            raise RefusedError(f"{path.name} is not loaded after {LOAD:g} s; nothing was started")
        return made[0]

    # ------------------------------------------------------------------ its thread
    def _run(self) -> None:
        while True:
            try:
                self._scan()
            except Exception:
                log.exception("experiment files")
            if self._closing.wait(PERIOD):
                return

    def _scan(self) -> None:
        present = _versions(self._folder, self._packaged)
        with self._lock:
            self._known = {p: known for p, known in self._known.items() if p in present}
            changed = [
                path
                for path, version in present.items()
                if path not in self._known or self._known[path][0] != version
            ]
            self._waiting = tuple(changed)
        for path in changed:
            if self._closing.is_set():
                return
            found = check(path, self._vehicle)
            with self._lock:
                self._known[path] = (present[path], found)
        with self._lock:
            self._waiting = ()


def _versions(folder: Path, packaged: Iterable[Path] = ()) -> dict[Path, Version]:
    """Return the files that may be experiments, without those of editors and of Python."""
    found = {}
    try:
        for path in (*sorted(folder.glob("*.py"))[:FILES_MAX], *packaged):
            if path.name[0] not in "._#" and path.is_file():
                about = path.stat()
                found[path] = (about.st_mtime_ns, about.st_size)
    except OSError:
        return found  # what has disappeared is noticed in the next scan
    return found
