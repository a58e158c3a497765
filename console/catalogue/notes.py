"""Notes about a run: the last writer wins, and earlier texts are kept."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sqlalchemy import delete, func, select

from console.catalogue.tables import NoteRow

if TYPE_CHECKING:
    from collections.abc import Sequence

    from console.catalogue.catalogue import Catalogue

KEPT = 50
"""Number of earlier texts kept for a run."""


@dataclass(frozen=True, slots=True)
class Note:
    """One present or earlier text of a run's notes."""

    version: int  # rises with each text of the whole catalogue; 0: never written
    text: str
    author: str
    stamp_ns: int  # epoch


@dataclass(frozen=True, slots=True)
class Written:
    """Result of writing notes. `replaced` is the text of another person that the writer had not
    seen.
    """

    note: Note
    replaced: Note | None


def write_notes(
    catalogue: Catalogue, run_id: str, text: str, author: str = "", seen: int | None = None
) -> Written:
    """Set the notes; the previous text stays in `notes_history`.

    Args:
        seen: the version that the writer saw; None skips the check.

    Raises StorageError for an unknown or deleted run.
    """
    with catalogue.session() as session:
        run = catalogue.existing(session, run_id)
        newest = session.scalar(
            select(NoteRow).where(NoteRow.run_id == run_id).order_by(NoteRow.version.desc())
        )
        before = _note(newest) if newest else Note(0, run.notes, "", 0)
        if text == before.text and newest is not None:
            return Written(before, None)
        if newest is None and before.text:  # written by a version without history
            session.add(NoteRow(run_id=run_id, text=before.text, author="", stamp_ns=0))
        run.notes = text
        row = NoteRow(run_id=run_id, text=text, author=author, stamp_ns=time.time_ns())
        session.add(row)
        session.flush()
        old = select(NoteRow.version).where(NoteRow.run_id == run_id)
        old = old.order_by(NoteRow.version.desc()).offset(KEPT + 1)
        session.execute(delete(NoteRow).where(NoteRow.version.in_(session.scalars(old).all())))
        missed = seen is not None and seen != before.version
        return Written(_note(row), before if missed else None)


def notes_history(catalogue: Catalogue, run_id: str) -> list[Note]:
    """Return all notes, newest first. Raises StorageError for an unknown or deleted run."""
    with catalogue.session() as session:
        catalogue.existing(session, run_id)
        rows = select(NoteRow).where(NoteRow.run_id == run_id).order_by(NoteRow.version.desc())
        return [_note(row) for row in session.scalars(rows)]


def newest_notes(catalogue: Catalogue, run_ids: Sequence[str]) -> dict[str, Note]:
    """Return run → its newest text, without the runs that have no notes."""
    with catalogue.session() as session:
        newest = select(func.max(NoteRow.version)).where(NoteRow.run_id.in_(run_ids))
        versions = session.scalars(newest.group_by(NoteRow.run_id)).all()
        rows = session.scalars(select(NoteRow).where(NoteRow.version.in_(versions)))
        return {row.run_id: _note(row) for row in rows}


def _note(row: NoteRow) -> Note:
    return Note(row.version, row.text, row.author, row.stamp_ns)
