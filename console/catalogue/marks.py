"""Event marks as stored in the catalogue, so that they can be listed without opening a log."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from sqlalchemy import func, select

from console.catalogue.tables import Mark

if TYPE_CHECKING:
    from console.catalogue.catalogue import Catalogue

LONGEST = 500
"""Maximum number of characters of a mark's text."""
OLDEST = 10.0
"""Longest time, in s, since the key press of a mark."""


def store_mark(catalogue: Catalogue, mark: Mark) -> None:
    """Store a new mark, or a new text of a known one."""
    with catalogue.session() as session:
        session.merge(mark)


def find_mark(catalogue: Catalogue, mark_id: str) -> Mark | None:
    """Return the mark with this id, of any run, or None."""
    with catalogue.session() as session:
        return session.scalar(select(Mark).where(Mark.id == mark_id))


def marks_of(catalogue: Catalogue, run_id: str) -> list[Mark]:
    """Return the marks ordered by time. Raises StorageError for an unknown or deleted run."""
    with catalogue.session() as session:
        catalogue.existing(session, run_id)
        marks = select(Mark).where(Mark.run_id == run_id).order_by(Mark.time, Mark.id)
        return list(session.scalars(marks))


def mark_counts(catalogue: Catalogue, run_ids: Sequence[str]) -> dict[str, int]:
    """Return run → number of its marks, without the runs that have none."""
    with catalogue.session() as session:
        query = select(Mark.run_id, func.count()).where(Mark.run_id.in_(run_ids))
        rows = session.execute(query.group_by(Mark.run_id))
        return {row[0]: row[1] for row in rows}
