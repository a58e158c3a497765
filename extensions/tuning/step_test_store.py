"""The last step tests, on disk: a description and the samples of each.

They are `<data>/tuning/<id>.json` and `<id>.npz`. Deleted ones stay in `deleted/` until there are
too many.
"""

from __future__ import annotations

import json
import os
import re
import threading
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from console.atomic_file import replacing
from extensions.tuning.collection import Gap, Samples
from extensions.tuning.evaluation import Plan
from quadrotor.errors import StorageError, os_errors
from quadrotor.parameter_description import ParameterValue

FOLDER = "tuning"
DELETED = "deleted"
KEPT = 20
_ID = re.compile(r"[0-9]{8}T[0-9]{9}Z_[A-Za-z0-9_-]{1,60}")


@dataclass(frozen=True)
class StepTest:
    """One test.

    Attributes:
        started: UTC, ISO 8601.
        run_id: of the station's recording that contains it, empty if there was none.
        gains: parameters in force when it began, by name.
        changed: those of them that were changed during the test.
        figures, edges, problems: see evaluation.Evaluation.
        file: on the vehicle.
        rate: ticks a second.
    """

    id: str
    started: str
    vehicle: str
    requester: str
    run_id: str
    plan: Plan
    gains: dict[str, ParameterValue]
    changed: list[str]
    figures: dict[str, float | None]
    edges: list[dict[str, float | None]]
    problems: list[str]
    file: str = ""
    rate: float = 0.0


class StepTestStore:
    """The stored tests, thread-safe. The folder in `data` is created when the first
    test is stored.
    """

    def __init__(self, data: Path, kept: int = KEPT) -> None:
        self._folder = data / FOLDER
        self._kept = kept
        self._lock = threading.Lock()

    def new_id(self, vehicle: str) -> str:
        """Return a new unique id made from the time."""
        with self._lock:
            while True:
                name = f"{datetime.now(UTC):%Y%m%dT%H%M%S%f}"[:-3] + f"Z_{vehicle}"
                if not self._path(name).exists():
                    return name

    def keep(self, run: StepTest, samples: Samples) -> None:
        """Store a test, and remove the oldest beyond the number kept. Raises StorageError."""
        with self._lock:
            with os_errors(lambda why: f"the test cannot be kept: {why}"):
                self._folder.mkdir(exist_ok=True)
                with replacing(self._path(run.id, ".npz")) as new, new.open("wb") as stream:
                    np.savez_compressed(
                        stream,
                        stamps_ns=samples.stamps_ns,
                        gaps=np.array([[g.start, g.end] for g in samples.gaps]).reshape(-1, 2),
                        **samples.values,  # type: ignore[arg-type]
                    )
                with replacing(self._path(run.id)) as new:
                    new.write_text(json.dumps(asdict(run), indent=1))
            self._prune(self._folder)

    def runs(self) -> list[StepTest]:
        """Return the stored tests, newest first; unreadable ones are left out."""
        with self._lock:
            found = (self._read(name) for name in reversed(self._names(self._folder)))
            return [run for run in found if run is not None]

    def run(self, name: str) -> StepTest:
        """Return a stored test. Raises StorageError when it is unknown."""
        with self._lock:
            self._known(name, self._folder)
            run = self._read(name)
        if run is None:
            raise StorageError(f"the test {name} cannot be read")
        return run

    def samples(self, name: str) -> Samples:
        """Return the samples of a stored test. Raises StorageError."""
        run = self.run(name)
        try:
            with np.load(self._path(name, ".npz")) as content:
                values = {k: content[k] for k in content.files if k not in ("stamps_ns", "gaps")}
                gaps = tuple(Gap(float(a), float(b)) for a, b in content["gaps"])
                return Samples(content["stamps_ns"], values, gaps, "", run.file)
        except (OSError, ValueError, KeyError) as error:
            raise StorageError(f"the samples of test {name} cannot be read: {error}") from error

    def delete(self, name: str) -> None:
        """Move a test to the folder of deleted tests. Raises StorageError."""
        with self._lock:
            self._move(name, self._folder, self._folder / DELETED)
            self._prune(self._folder / DELETED)

    def restore(self, name: str) -> None:
        """Undo a deletion. Raises StorageError."""
        with self._lock:
            self._move(name, self._folder / DELETED, self._folder)

    # ------------------------------------------------------------------ with the lock held
    def _move(self, name: str, here: Path, there: Path) -> None:
        self._known(name, here)
        with os_errors(lambda why: f"the test {name} cannot be moved: {why}"):
            there.mkdir(exist_ok=True)
            for suffix in (".npz", ".json"):
                os.replace(here / f"{name}{suffix}", there / f"{name}{suffix}")

    def _read(self, name: str) -> StepTest | None:
        try:
            content: dict[str, Any] = json.loads(self._path(name).read_text())
            return StepTest(**{**content, "plan": Plan(**content["plan"])})
        except (OSError, ValueError, TypeError, KeyError):
            return None

    def _known(self, name: str, folder: Path) -> None:
        """Raise StorageError for an unknown name from outside; it is looked up, never
        made a path.
        """
        if name not in self._names(folder):
            raise StorageError(f"there is no step test {name!r:.80}; the Tune tab lists all")

    def _names(self, folder: Path) -> list[str]:
        """Return the names, oldest first."""
        try:
            found = [path.stem for path in folder.glob("*.json")]
        except OSError:
            return []
        return sorted(name for name in found if _ID.fullmatch(name))

    def _prune(self, folder: Path) -> None:
        for name in self._names(folder)[: -self._kept]:
            for suffix in (".json", ".npz"):
                (folder / f"{name}{suffix}").unlink(missing_ok=True)

    def _path(self, name: str, suffix: str = ".json") -> Path:
        return self._folder / f"{name}{suffix}"
