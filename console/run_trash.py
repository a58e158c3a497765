"""Deleting runs with undo: their files wait in `runs/trash/`, on the same disk, for some days.

A deleted run is in no list and its file is not opened; what the vehicle logged on board is never
touched. A crash between the line in the catalogue and the move of the file undoes the deletion.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from glob import escape
from pathlib import Path

from sqlalchemy import delete, select

from console.catalogue import SUFFIX, Catalogue
from console.catalogue_tables import MarkRow, NoteRow, RunRow, TagRow, TrashRow
from console.run_reports import report_folder
from quadrotor.errors import RefusedError, StorageError
from vehicle_link.log.file import is_being_written

TRASH = "trash"
MADE_AGAIN = (".viser",)
"""Endings of `<run>.…` files that are made again when asked for; not kept."""


@dataclass(frozen=True, slots=True)
class Deleted:
    """A run in the trash."""

    id: str
    vehicle: str
    start_ns: int  # epoch
    duration: float  # s
    bytes: int
    deleted_ns: int  # epoch
    requester: str


def delete_run(catalogue: Catalogue, run_id: str, requester: str) -> None:
    """To the trash.

    Raises RefusedError while it is being recorded, StorageError when it is unknown or cannot be
    moved.
    """
    log = _file_of(catalogue, run_id)
    if log.exists() and is_being_written(log):
        raise RefusedError(f"run {run_id} is being recorded; stop the recording first")
    with catalogue.session() as session:
        catalogue.existing(session, run_id)
        session.add(TrashRow(run_id=run_id, deleted_ns=time.time_ns(), requester=requester))
    try:
        _move(_belongings(log), catalogue.folder / TRASH)
    except StorageError:
        _back_in_the_list(catalogue, run_id)
        raise
    for path in list(log.parent.glob(f"{escape(log.stem)}.*")):
        if path.suffix in MADE_AGAIN:
            path.unlink(missing_ok=True)


def restore_run(catalogue: Catalogue, run_id: str) -> None:
    """Out of the trash, with notes, tags and marks. Raises StorageError."""
    log = _file_of(catalogue, run_id)
    with catalogue.session() as session:
        if session.get(TrashRow, run_id) is None:
            raise StorageError(f"run {run_id!r} is not in the trash")
    trash = catalogue.folder / TRASH
    _move(_belongings(trash / log.name), catalogue.folder)
    _back_in_the_list(catalogue, run_id)


def deleted_runs(catalogue: Catalogue) -> list[Deleted]:
    """The newest deletion first."""
    query = select(RunRow, TrashRow).join(TrashRow, TrashRow.run_id == RunRow.id)
    with catalogue.session() as session:
        rows = session.execute(query.order_by(TrashRow.deleted_ns.desc(), RunRow.id.desc()))
        return [
            Deleted(
                run.id, run.vehicle, run.start_ns, run.duration, run.bytes,
                trash.deleted_ns, trash.requester,
            )
            for run, trash in rows
        ]  # fmt: skip


def purge(catalogue: Catalogue, older_than: float = 0.0) -> list[str]:
    """Removes for good what was deleted more than `older_than` s ago; the ids.

    Raises StorageError; what was removed before stays removed.
    """
    before_ns = time.time_ns() - round(older_than * 1e9)
    gone = [run.id for run in deleted_runs(catalogue) if run.deleted_ns <= before_ns]
    for run_id in gone:
        log = catalogue.folder / TRASH / _file_of(catalogue, run_id).name
        try:
            for path in _belongings(log):
                shutil.rmtree(path) if path.is_dir() else path.unlink()
        except OSError as error:
            raise StorageError(
                f"run {run_id} cannot be removed from {log.parent}: {error.strerror}"
            ) from error
        with catalogue.session() as session:
            for table in (TagRow, NoteRow, MarkRow, TrashRow):
                session.execute(delete(table).where(table.run_id == run_id))
            session.execute(delete(RunRow).where(RunRow.id == run_id))
    return gone


def undo_half_deletions(catalogue: Catalogue) -> list[str]:
    """Runs whose file never reached the trash are listed again; their ids. Raises StorageError."""
    half = [
        run.id
        for run in deleted_runs(catalogue)
        if (log := _file_of(catalogue, run.id)).exists()
        and not (catalogue.folder / TRASH / log.name).exists()
    ]
    for run_id in half:
        restore_run(catalogue, run_id)
    return half


def _file_of(catalogue: Catalogue, run_id: str) -> Path:
    """Of a listed or deleted run, in the runs folder. Raises StorageError."""
    with catalogue.session() as session:
        run = session.get(RunRow, run_id)
        if run is None:
            catalogue.existing(session, run_id)  # says so
        assert run is not None
        log = catalogue.folder / run.file
    if log.name != run.file or log.suffix != SUFFIX:
        raise StorageError(f"the file of run {run_id!r} does not lie in {catalogue.folder}")
    return log


def _belongings(log: Path) -> Iterator[Path]:
    """What of a run lies in the folder of `log`."""
    yield from (path for path in (log, report_folder(log)) if path.exists())


def _move(paths: Iterator[Path] | Sequence[Path], folder: Path) -> None:
    """All or nothing, within one disk. Raises StorageError."""
    moved: list[tuple[Path, Path]] = []
    try:
        folder.mkdir(exist_ok=True)
        for path in list(paths):
            place = folder / path.name
            if place.exists():
                raise StorageError(f"{place} exists already; move or rename it")
            path.rename(place)
            moved.append((path, place))
    except (OSError, StorageError) as error:
        for path, place in moved:
            place.rename(path)
        if isinstance(error, StorageError):
            raise
        raise StorageError(f"cannot move to {folder}: {error.strerror}; is it writable?") from error


def _back_in_the_list(catalogue: Catalogue, run_id: str) -> None:
    with catalogue.session() as session:
        session.execute(delete(TrashRow).where(TrashRow.run_id == run_id))
