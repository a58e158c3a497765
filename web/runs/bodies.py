"""Bodies of a page's requests about runs."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from console.catalogue.marks import LONGEST, OLDEST
from web.body import Body

RunId = Annotated[str, Field(min_length=1, max_length=120)]
Tag = Annotated[str, Field(min_length=1, max_length=80)]


class NotesBody(Body):
    notes: str = Field(max_length=10_000)
    seen: int | None = Field(None, ge=0, description="version of the notes that the writer saw")


class TitleBody(Body):
    title: str = Field(max_length=400, description="empty: the automatic one again")


class RunsBody(Body):
    runs: list[RunId] = Field(min_length=1, max_length=2000)


class TagsBody(RunsBody):
    add: list[Tag] = Field([], max_length=20)
    remove: list[Tag] = Field([], max_length=20)


class MarkBody(Body):
    id: str = Field(
        pattern=r"^[A-Za-z0-9_-]{8,64}$", description="a new one marks, a known one gets the text"
    )
    text: str = Field("", max_length=LONGEST)
    ago: float | None = Field(
        None, ge=0.0, le=OLDEST, description="s since the key was pressed; of a new mark"
    )
