"""Event marks as stored in the catalogue, so that they can be listed without opening a log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from sqlalchemy import func, select

from console.catalogue.tables import MarkRow

if TYPE_CHECKING:
    from console.catalogue.catalogue import Catalogue

LONGEST = 500
"""Maximum number of characters of a mark's text."""
OLDEST = 10.0
"""Longest time, in s, since the key press of a mark."""


@dataclass(frozen=True, slots=True)
class Mark:
    """A moment of a run that a person marked."""

    run_id: str
    id: str
    stamp_ns: int  # the vehicle's clock when the key was pressed
    time: float  # s since the start of the run
    text: str
    requester: str


def store_mark(catalogue: Catalogue, mark: Mark) -> None:
    """Store a new mark, or a new text of a known one."""
    with catalogue.session() as session:
        session.merge(MarkRow(**asdict(mark)))


def find_mark(catalogue: Catalogue, mark_id: str) -> Mark | None:
    """Return the mark with this id, of any run, or None."""
    with catalogue.session() as session:
        row = session.scalar(select(MarkRow).where(MarkRow.id == mark_id))
        return _mark(row) if row else None


def marks_of(catalogue: Catalogue, run_id: str) -> list[Mark]:
    """Return the marks ordered by time. Raises StorageError for an unknown or deleted run."""
    with catalogue.session() as session:
        catalogue.existing(session, run_id)
        rows = select(MarkRow).where(MarkRow.run_id == run_id).order_by(MarkRow.time, MarkRow.id)
        return [_mark(row) for row in session.scalars(rows)]


def mark_counts(catalogue: Catalogue, run_ids: Sequence[str]) -> dict[str, int]:
    """Return run → number of its marks, without the runs that have none."""
    with catalogue.session() as session:
        query = select(MarkRow.run_id, func.count()).where(MarkRow.run_id.in_(run_ids))
        rows = session.execute(query.group_by(MarkRow.run_id))
        return {row[0]: row[1] for row in rows}


def _mark(row: MarkRow) -> Mark:
    return Mark(row.run_id, row.id, row.stamp_ns, row.time, row.text, row.requester)
