"""Tags of runs: short words without order, always in the spelling that was used first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from sqlalchemy import delete, func, select

from console.catalogue.search import NOT_DELETED
from console.catalogue.tables import RunEntry, TagRow
from quadrotor.errors import ParameterError

if TYPE_CHECKING:
    from console.catalogue.catalogue import Catalogue

LONGEST = 40
MOST = 20
"""Maximum number of tags of one run."""


def all_tags(catalogue: Catalogue) -> dict[str, int]:
    """Return tag → number of runs that have it, most used first; deleted runs do not count."""
    with catalogue.session() as session:
        count = func.count().label("count")
        query = select(TagRow.tag, count).join(RunEntry, RunEntry.id == TagRow.run_id)
        query = query.where(NOT_DELETED).group_by(TagRow.tag).order_by(count.desc(), TagRow.tag)
        return {row[0]: row[1] for row in session.execute(query)}


def tags_of(catalogue: Catalogue, run_ids: Sequence[str]) -> dict[str, list[str]]:
    """Return run → its tags in alphabetical order, without the runs that have none."""
    found: dict[str, list[str]] = {}
    with catalogue.session() as session:
        rows = select(TagRow.run_id, TagRow.tag).where(TagRow.run_id.in_(run_ids))
        for run_id, tag in session.execute(rows.order_by(func.lower(TagRow.tag))):
            found.setdefault(run_id, []).append(tag)
    return found


def change_tags(
    catalogue: Catalogue, run_ids: Sequence[str], add: Sequence[str], remove: Sequence[str]
) -> dict[str, list[str]]:
    """Add and remove the same tags for several runs, all or nothing; return run → tags afterwards.

    Raises StorageError for an unknown run, ParameterError for a text that cannot be a tag.
    """
    with catalogue.session() as session:
        spelled = {tag.casefold(): tag for tag in session.scalars(select(TagRow.tag).distinct())}
        wanted = dict.fromkeys(spelled.get(t.casefold(), t) for t in map(checked, add))
        unwanted = {tag.strip().casefold() for tag in remove}
        for run_id in run_ids:
            catalogue.existing(session, run_id)
            has = list(session.scalars(select(TagRow.tag).where(TagRow.run_id == run_id)))
            gone = [tag for tag in has if tag.casefold() in unwanted]
            new = [tag for tag in wanted if tag not in has]
            if len(has) - len(gone) + len(new) > MOST:
                raise ParameterError(f"run {run_id} would have more than {MOST} tags; remove some")
            session.execute(delete(TagRow).where(TagRow.run_id == run_id, TagRow.tag.in_(gone)))
            session.add_all(TagRow(run_id=run_id, tag=tag) for tag in new)
    tags = tags_of(catalogue, run_ids)
    return {run_id: tags.get(run_id, []) for run_id in run_ids}


def checked(text: str) -> str:
    """Return the tag with whitespace normalized. Raises ParameterError."""
    tag = " ".join(text.split())
    if not 0 < len(tag) <= LONGEST or not tag.isprintable() or "," in tag:
        raise ParameterError(
            f"{text!r:.60} cannot be a tag: use 1 to {LONGEST} characters and no comma"
        )
    return tag
