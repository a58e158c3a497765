"""A search for runs: words, a tag, a vehicle, a span of time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, and_, exists, func, or_, select

from console.catalogue.tables import Mark, RunEntry, TagRow, TitleRow, TrashRow

MOST_WORDS = 12


@dataclass(frozen=True, slots=True)
class RunSearch:
    """A search for runs: all criteria must match, and empty ones are ignored.

    Args:
        words: each must occur in id, title, operator, notes, vehicle, a tag or the text of a mark.
        tag: must match exactly, except for case.
        since_ns, until_ns: bounds of the start, epoch, the second one excluded; 0 = none.
    """

    words: str = ""
    tag: str = ""
    vehicle: str = ""
    since_ns: int = 0
    until_ns: int = 0


NOT_DELETED: ColumnElement[bool] = RunEntry.id.not_in(select(TrashRow.run_id))


def condition(search: RunSearch) -> ColumnElement[bool]:
    """Return the condition for a query of runs; deleted ones are never found."""
    wanted: list[Any] = [NOT_DELETED]
    if search.vehicle:
        wanted.append(RunEntry.vehicle == search.vehicle)
    if search.since_ns:
        wanted.append(RunEntry.start_ns >= search.since_ns)
    if search.until_ns:
        wanted.append(RunEntry.start_ns < search.until_ns)
    if search.tag:
        same = TagRow.tag.ilike(_literally(search.tag), escape="\\")
        wanted.append(exists().where(TagRow.run_id == RunEntry.id, same))
    wanted += [_has(word) for word in search.words.split()[:MOST_WORDS]]
    return and_(*wanted)


def _has(word: str) -> ColumnElement[bool]:
    columns = (RunEntry.id, RunEntry.operator, RunEntry.notes, RunEntry.vehicle)
    return or_(
        *(column.icontains(word, autoescape=True) for column in columns),
        exists().where(
            TitleRow.run_id == RunEntry.id,
            func.coalesce(func.nullif(TitleRow.written, ""), TitleRow.automatic).icontains(
                word, autoescape=True
            ),
        ),
        exists().where(TagRow.run_id == RunEntry.id, TagRow.tag.icontains(word, autoescape=True)),
        exists().where(Mark.run_id == RunEntry.id, Mark.text.icontains(word, autoescape=True)),
    )


def _literally(text: str) -> str:
    return text.replace("\\", "\\\\").replace("%", "\\%").replace("_", "\\_")
