"""The content of a report, before it is a page or a PDF: headings, texts, tables, pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Heading:
    text: str


@dataclass(frozen=True)
class Text:
    """A paragraph; a `warning` is one to be seen."""

    text: str
    warning: bool = False


@dataclass(frozen=True)
class Table:
    """Rows of words.

    Attributes:
        title: above it, or what unfolds it.
        numeric: columns whose cells are numbers.
        folded: shown on the page only when it is unfolded.
        widths: of the columns on paper, shares of the whole.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    numeric: frozenset[int] = frozenset()
    folded: bool = False
    widths: Sequence[float] = ()


@dataclass(frozen=True)
class Picture:
    """`draw` fills a figure of `height` (in, at a width of WIDTH) with its axes."""

    title: str
    caption: str
    description: str  # for those who cannot see it
    height: float
    draw: Callable[[Any], None]


Block = Heading | Text | Table | Picture

WIDTH = 7.2
"""in, of every picture: the width of a page of paper without its margins."""


@dataclass
class Report:
    """A whole report.

    Attributes:
        verdict: passed, failed, not_judged or empty.
        facts: name and value, the first thing below the title.
    """

    title: str
    subtitle: str
    verdict: str
    verdict_reason: str
    facts: list[tuple[str, str]] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)
