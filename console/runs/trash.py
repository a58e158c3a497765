"""Deletion of runs with undo: their files stay in `runs/trash/`, on the same disk, for some days.

A deleted run is in no list and its file is not opened; the vehicle's own logs are never touched.

The location of the log decides: it is moved by one rename, and the catalogue's entry follows. A
process that finds the two in between, at its start or after a crash, completes the move
(`finish_moves`).
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from glob import escape
from pathlib import Path

from sqlalchemy import delete, select

from console.catalogue.catalogue import SUFFIX, Catalogue, runs_in
from console.catalogue.search import NOT_DELETED
from console.catalogue.tables import (
    CompletenessRow,
    Mark,
    NoteRow,
    RunEntry,
    TagRow,
    TitleRow,
    TrashRow,
)
from flight_log.columns.places import place_of
from flight_log.file import is_being_written
from quadrotor.errors import RefusedError, StorageError, os_errors
from vehicle_link.clock import host_time_ns

TRASH = "trash"
MADE_AGAIN = (".viser",)
"""Endings of `<run>.…` files of earlier versions that are not kept."""


@dataclass(frozen=True, slots=True)
class DeletedRun:
    """A run in the trash."""

    id: str
    vehicle: str
    start_ns: int  # epoch
    duration: float  # s
    bytes: int
    deleted_ns: int  # epoch
    requester: str


@dataclass(frozen=True, slots=True)
class Purged:
    """The result of emptying the trash."""

    done: list[str] = field(default_factory=list)  # ids
    refused: dict[str, str] = field(default_factory=dict)  # id -> reason; these stay


def delete_run(catalogue: Catalogue, run_id: str, requester: str) -> None:
    """Move a run to the trash.

    Raises RefusedError while it is being recorded, StorageError when it is unknown or cannot be
    moved.
    """
    log = _file_of(catalogue, run_id)
    if log.exists() and is_being_written(log):
        raise RefusedError(f"run {run_id} is being recorded; stop the recording first")
    with catalogue.session() as session:
        catalogue.existing(session, run_id)
    trash = catalogue.folder / TRASH
    _move(log, trash)
    try:
        _out_of_the_list(catalogue, run_id, requester)
    except StorageError:
        _move(trash / log.name, catalogue.folder)
        raise
    if not (trash / log.name).is_dir():
        for path in list(log.parent.glob(f"{escape(log.stem)}.*")):
            if path.suffix in MADE_AGAIN:
                path.unlink(missing_ok=True)
    shutil.rmtree(place_of(log), ignore_errors=True)


def restore_run(catalogue: Catalogue, run_id: str) -> None:
    """Restore a run from the trash, with notes, tags and marks. Raises StorageError."""
    log = _file_of(catalogue, run_id)
    if not is_deleted(catalogue, run_id):
        raise StorageError(f"run {run_id!r} is not in the trash")
    _move(catalogue.folder / TRASH / log.name, catalogue.folder)
    _back_in_the_list(catalogue, run_id)


def deleted_runs(catalogue: Catalogue) -> list[DeletedRun]:
    """Return the deleted runs, the newest deletion first."""
    query = select(RunEntry, TrashRow).join(TrashRow, TrashRow.run_id == RunEntry.id)
    with catalogue.session() as session:
        rows = session.execute(query.order_by(TrashRow.deleted_ns.desc(), RunEntry.id.desc()))
        return [
            DeletedRun(
                run.id,
                run.vehicle,
                start_ns=run.start_ns,
                duration=run.duration,
                bytes=run.bytes,
                deleted_ns=trash.deleted_ns,
                requester=trash.requester,
            )
            for run, trash in rows
        ]


def purge(catalogue: Catalogue, older_than: float = 0.0) -> Purged:
    """Remove permanently what was deleted more than `older_than` s ago; runs that cannot be removed
    stay.

    Raises StorageError when the catalogue cannot be used.
    """
    before_ns = host_time_ns() - round(older_than * 1e9)
    purged = Purged()
    for run in deleted_runs(catalogue):
        if run.deleted_ns <= before_ns:
            try:
                _remove(catalogue, run.id)
                purged.done.append(run.id)
            except StorageError as error:
                if is_deleted(catalogue, run.id):  # else another process was quicker
                    purged.refused[run.id] = str(error)
    return purged


def is_deleted(catalogue: Catalogue, run_id: str) -> bool:
    """Return whether the catalogue lists the run as deleted. Raises StorageError."""
    with catalogue.session() as session:
        return session.get(TrashRow, run_id) is not None


def is_in_trash(catalogue: Catalogue, file: str) -> bool:
    """Return whether the log called `file` is in the trash."""
    return (catalogue.folder / TRASH / file).exists()


def finish_moves(catalogue: Catalogue) -> list[str]:
    """Finish moves that a crash or another process interrupted; return one line for each.

    A listed run whose log is in the trash is deleted, a deleted one whose log is among the runs is
    listed again. Raises StorageError.
    """
    lines = []
    for run in deleted_runs(catalogue):
        log = _file_of(catalogue, run.id)
        if log.exists() and not is_in_trash(catalogue, log.name):
            restore_run(catalogue, run.id)
            lines.append(f"run {run.id}: its deletion was undone")
    for path in sorted(runs_in(catalogue.folder / TRASH)):
        log = catalogue.folder / path.name
        with catalogue.session() as session:
            query = select(RunEntry.id).where(RunEntry.file == path.name, NOT_DELETED)
            run_id = session.scalar(query)
        if run_id is not None and not log.exists():
            _move(log, path.parent)
            _out_of_the_list(catalogue, run_id, "")
            lines.append(f"run {run_id}: its deletion was finished")
    return lines


def _remove(catalogue: Catalogue, run_id: str) -> None:
    """Remove a run's files permanently, the log last, so that the rest can be restored. Raises
    StorageError.
    """
    log = catalogue.folder / TRASH / _file_of(catalogue, run_id).name
    with os_errors(lambda why: f"run {run_id} cannot be removed from {log.parent}: {why}"):
        for path in reversed(list(_belongings(log))):
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    with catalogue.session() as session:
        for table in (TagRow, TitleRow, NoteRow, Mark, CompletenessRow, TrashRow):
            session.execute(delete(table).where(table.run_id == run_id))
        session.execute(delete(RunEntry).where(RunEntry.id == run_id))


def _file_of(catalogue: Catalogue, run_id: str) -> Path:
    """Return the file of a listed or deleted run, in the runs folder. Raises StorageError."""
    with catalogue.session() as session:
        run = session.get(RunEntry, run_id)
        if run is None:
            catalogue.existing(session, run_id)  # raises the error
        assert run is not None
        log = catalogue.folder / run.file
    if log.name != run.file or log.suffix not in (SUFFIX, ""):
        raise StorageError(f"the file of run {run_id!r} is not inside {catalogue.folder}")
    return log


def _belongings(log: Path) -> Iterator[Path]:
    """Yield the files of a run in the folder of `log`, the log first."""
    yield from (path for path in (log, log.with_name(f"{log.stem}_report")) if path.exists())


def _move(log: Path, folder: Path) -> None:
    """Move a run's log and then its other files, within one disk: all or nothing. Raises
    StorageError.

    Files that have disappeared were moved by another process that does the same.
    """
    moved: list[tuple[Path, Path]] = []
    try:
        folder.mkdir(exist_ok=True)
        for path in list(_belongings(log)):
            place = folder / path.name
            if place.exists():
                if not path.exists():
                    continue
                raise StorageError(f"{place} exists already; move or rename it")
            with suppress(FileNotFoundError):
                path.rename(place)
                moved.append((path, place))
    except (OSError, StorageError) as error:
        for path, place in reversed(moved):
            place.rename(path)
        if isinstance(error, StorageError):
            raise
        raise StorageError(f"cannot move to {folder}: {error.strerror}; is it writable?") from error


def _out_of_the_list(catalogue: Catalogue, run_id: str, requester: str) -> None:
    """Mark a run as deleted, once, even if several processes try; a requester's name is kept.
    Raises StorageError.
    """
    try:
        with catalogue.session() as session:
            row = session.get(TrashRow, run_id)
            if row is None:
                row = TrashRow(run_id=run_id, deleted_ns=host_time_ns(), requester="")
                session.add(row)
            row.requester = requester or row.requester
    except StorageError:  # another process may have been slightly quicker
        if not is_deleted(catalogue, run_id):
            raise


def _back_in_the_list(catalogue: Catalogue, run_id: str) -> None:
    with catalogue.session() as session:
        session.execute(delete(TrashRow).where(TrashRow.run_id == run_id))
