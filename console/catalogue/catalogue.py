"""The catalogue of runs: SQLite in the data folder by default, any server by URL.

The page and the station share it; names from outside become paths only through `resolve`.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sqlalchemy import create_engine, event, func, select
from sqlalchemy.orm import Session

from console.catalogue.database_file import DatabaseFile
from console.catalogue.search import RunSearch, condition
from console.catalogue.tables import Base, RunEntry, TrashRow
from console.catalogue.transactions import transactions
from flight_log.columns.places import CACHES
from flight_log.run_folder import RUNS, log_of
from quadrotor.errors import StorageError

DATABASE = "catalogue.sqlite"
SUFFIX = ".mcap"


class Catalogue:
    """The catalogue of runs, safe to use from several threads and processes. Every method may raise
    StorageError.

    Args:
        data: the data folder; runs are in its `runs`.
        url: of another database (SQLAlchemy); default is SQLite in the data folder.

    Attributes:
        session: begins a transaction.
    """

    def __init__(self, data: Path, url: str | None = None) -> None:
        self.folder = data / RUNS
        try:
            (self.folder / CACHES).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StorageError(
                f"cannot make the folder {self.folder} ({error.strerror}); "
                "choose another with --data"
            ) from error
        self.engine = create_engine(url or f"sqlite:///{data / DATABASE}")
        """The engine of the database, for the tables of other modules."""
        if self.engine.dialect.name == "sqlite":
            event.listen(self.engine, "connect", _set_up_sqlite)
        self.session = transactions(
            self.engine,
            Base.metadata,
            "the catalogue of runs",
            "; the logs themselves are not touched",
        )
        self._file = DatabaseFile(self.engine, data)

    @property
    def problem(self) -> str:
        """Return why nothing can be saved (its file or the data folder is missing) and what to do;
        or "".
        """
        return self._file.problem()

    def close(self) -> None:
        self.engine.dispose()

    def add(self, entry: RunEntry) -> None:
        """Add a new run, or update a known one; notes already written are kept."""
        with self.session() as session:
            known = session.get(RunEntry, entry.id)
            session.merge(entry if known is None else replace(entry, notes=known.notes))

    def update(self, run_id: str, **values: Any) -> None:
        """Change columns of a run. Raises StorageError for an unknown or deleted run."""
        with self.session() as session:
            row = self.existing(session, run_id)
            for name, value in values.items():
                if name not in RunEntry.__table__.columns:
                    raise AttributeError(f"runs have no column {name!r}")
                setattr(row, name, value)

    def get(self, run_id: str) -> RunEntry:
        """Return a run's entry. Raises StorageError for an unknown or deleted run."""
        with self.session() as session:
            return self.existing(session, run_id)

    def runs(
        self, search: RunSearch | str = "", vehicle: str = "", limit: int = 200, offset: int = 0
    ) -> list[RunEntry]:
        """Return the runs, newest first, without deleted ones. A text is searched for as words."""
        query = select(RunEntry).where(condition(_search(search, vehicle)))
        query = query.order_by(RunEntry.start_ns.desc(), RunEntry.id.desc())
        with self.session() as session:
            return list(session.scalars(query.limit(limit).offset(offset)))

    def count(self, search: RunSearch | str = "", vehicle: str = "") -> int:
        """Return the number of runs that `runs` would list."""
        query = select(func.count()).select_from(RunEntry)
        with self.session() as session:
            return session.scalar(query.where(condition(_search(search, vehicle)))) or 0

    def remove(self, run_id: str) -> None:
        """Remove a run from the catalogue; its file stays."""
        with self.session() as session:
            session.delete(self.existing(session, run_id))

    def resolve(self, run_id: str) -> Path:
        """Return the folder of a catalogued run, or its single file (`flight_log.run_folder`),
        never anything outside the runs folder.

        Raises StorageError for an unknown or deleted run, a missing file, or a name that leads
        elsewhere.
        """
        entry = self.get(run_id)
        folder = self.folder.resolve()
        path = (folder / entry.file).resolve()
        if path.parent != folder or not (path.suffix == SUFFIX or path.is_dir() or not path.suffix):
            raise StorageError(f"the file of run {run_id!r} is not inside {folder}; not opened")
        if not log_of(path).is_file():
            raise StorageError(f"the file of run {run_id} is gone: {path}")
        return path

    def existing(self, session: Session, run_id: str) -> RunEntry:
        """Return the row of a run within `session`. Raises StorageError for an unknown or deleted
        run.
        """
        row = session.get(RunEntry, run_id)
        if row is None:
            raise StorageError(f"no run {run_id!r} in the catalogue; list them on the Runs page")
        if session.get(TrashRow, run_id) is not None:
            raise StorageError(f"run {run_id} was deleted; undo that on the Runs page first")
        return row


def runs_in(folder: Path) -> list[Path]:
    """Return the runs in a folder: those that are folders, then single files, both sorted by name.
    Raises OSError.
    """
    found = sorted(folder.iterdir()) if folder.is_dir() else []
    folders = [path for path in found if path.is_dir() and log_of(path).is_file()]
    return folders + [path for path in found if path.suffix == SUFFIX]


def run_name(
    now: datetime, vehicle: str, folder: Path, taken: Collection[str] = frozenset()
) -> str:
    """Return `20260131T093042Z_quad1`, with `_2`, `_3`, … when that is in `taken` or its folder or
    file exists.
    """
    name = stem = f"{now.astimezone(UTC):%Y%m%dT%H%M%SZ}_{vehicle}"
    number = 1
    while name in taken or (folder / name).exists() or (folder / f"{name}{SUFFIX}").exists():
        number += 1
        name = f"{stem}_{number}"
    return name


def _search(search: RunSearch | str, vehicle: str) -> RunSearch:
    return RunSearch(words=search, vehicle=vehicle) if isinstance(search, str) else search


def _set_up_sqlite(connection: Any, _record: Any) -> None:
    cursor = connection.cursor()
    # Readers (the page) never block the writer (the station), which may wait for another writer.
    cursor.execute("PRAGMA journal_mode=WAL")
    cursor.execute("PRAGMA busy_timeout=5000")
    cursor.execute("PRAGMA synchronous=NORMAL")
    cursor.close()
