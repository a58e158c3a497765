"""Titles of runs: one by the station, from what was flown, and one that a person wrote instead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sqlalchemy import select

from console.catalogue.tables import TitleRow
from quadrotor.errors import ParameterError

if TYPE_CHECKING:
    from console.catalogue.catalogue import Catalogue

LONGEST = 120


@dataclass(frozen=True, slots=True)
class Title:
    """The title of a run. `author` is the person who wrote it, "" where the station made it."""

    text: str
    author: str = ""


def store_title(catalogue: Catalogue, run_id: str, text: str) -> None:
    """Store the station's title; one that a person wrote stays. Raises StorageError."""
    with catalogue.session() as session:
        row = session.get(TitleRow, run_id) or TitleRow(run_id=run_id)
        row.automatic = text[:LONGEST]
        session.add(row)


def write_title(catalogue: Catalogue, run_id: str, text: str, author: str) -> None:
    """Write a title by hand; an empty one brings the station's back.

    Raises StorageError for an unknown or deleted run, ParameterError for a text that cannot be one.
    """
    words = " ".join(text.split())
    if len(words) > LONGEST or not words.isprintable():
        raise ParameterError(
            f"{words!r:.60} has {len(words)} characters; a title is one line of at most {LONGEST}"
        )
    with catalogue.session() as session:
        catalogue.existing(session, run_id)
        row = session.get(TitleRow, run_id) or TitleRow(run_id=run_id)
        row.written, row.author = words, author if words else ""
        session.add(row)


def titles_of(catalogue: Catalogue, run_ids: Sequence[str]) -> dict[str, Title]:
    """Return run → title, without the runs that have none."""
    with catalogue.session() as session:
        rows = session.scalars(select(TitleRow).where(TitleRow.run_id.in_(run_ids)))
        found = {row.run_id: Title(row.written or row.automatic, row.author) for row in rows}
    return {run_id: title for run_id, title in found.items() if title.text}
