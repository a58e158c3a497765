"""Runs for the page: the catalogue's list and the log files themselves.

A run is found by its id in the catalogue and never by a path from outside; its file must lie
in the runs folder all the same.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

from quadrotor.errors import StorageError


class RunCatalogue(Protocol):
    """What the page needs of `console.catalogue`."""

    def runs(self) -> list[dict[str, Any]]:
        """Newest first, JSON-ready, each with an `id`. Raises StorageError."""
        ...

    def path(self, run_id: str) -> Path | None:
        """The file of a run, or None when there is no such run. Raises StorageError."""
        ...


def log_file(catalogue: RunCatalogue, folder: Path, run_id: str) -> Path | None:
    """The log to send, or None for an unknown run. Raises StorageError when its file is gone."""
    path = catalogue.path(run_id)
    if path is None or not path.resolve().is_relative_to(folder.resolve()):
        return None
    if not path.is_file():
        raise StorageError(f"the file of run {run_id} is gone; it was {path.name}")
    return path
