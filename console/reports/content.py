"""The content of a report, before it is a page or a PDF: headings, texts, tables, pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Heading:
    text: str


@dataclass(frozen=True)
class Text:
    """A paragraph; a `warning` is highlighted."""

    text: str
    warning: bool = False


@dataclass(frozen=True)
class Table:
    """A table of texts.

    Attributes:
        title: its caption, or the label that unfolds it.
        layout: width in percent and alignment of each column, like "70l 30r"; r for numbers.
        folded: whether the page shows it only when it is unfolded.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    layout: str
    folded: bool = False

    @property
    def widths(self) -> list[float]:
        """Return the widths of the columns on paper, as shares of the whole."""
        return [int(one[:-1]) / 100 for one in self.layout.split()]

    @property
    def numeric(self) -> set[int]:
        """Return the indices of the columns with numbers."""
        return {k for k, one in enumerate(self.layout.split()) if one.endswith("r")}


@dataclass(frozen=True)
class Picture:
    """A figure; `draw` fills it with axes, `height` is in inches at a width of WIDTH."""

    title: str
    caption: str
    description: str  # alternative text for screen readers
    height: float
    draw: Callable[[Figure], None]
    link: str = ""  # to the moment in the replay

    @cached_property
    def figure(self) -> Figure:
        """Return the matplotlib figure, laid out once for page and PDF; its dpi are a PDF's."""
        from matplotlib.backends.backend_svg import FigureCanvasSVG
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, self.height), dpi=72, layout="constrained")
        FigureCanvasSVG(figure)
        self.draw(figure)
        engine = figure.get_layout_engine()
        assert engine is not None
        engine.execute(figure)
        figure.set_layout_engine("none")  # with one, matplotlib would draw twice
        return figure


Block = Heading | Text | Table | Picture

WIDTH = 7.2
"""in, width of every figure: that of a paper page without its margins."""


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
