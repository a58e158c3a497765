"""The report as a PDF: A4 pages, made with matplotlib alone."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

from console.plots import STYLE
from console.reports.content import WIDTH, Heading, Picture, Report, Table, Text
from extensions.reports.html import GENERATOR, LOUD, WORDS

PAGE = (8.27, 11.69)
MARGIN = (PAGE[0] - WIDTH) / 2
TOP, BOTTOM = 0.7, 0.75
LINE = 0.165  # in, at SIZE
SIZE = 8.0
LETTER = 0.0665
"""Width of an average letter at SIZE, in inches; a little wide, so that lines end before the
margin."""


class Pages:
    """Lays out blocks from top to bottom, with a new page when one does not fit."""

    def __init__(self, pdf: Any, title: str) -> None:
        self._pdf, self._title = pdf, title
        self._number = 0
        self._figure: Any = None
        self._at = 0.0  # in, from the top
        self._begin()

    def close(self) -> None:
        self._pdf.savefig(self._figure)

    def text(
        self,
        text: str,
        *,
        size: float = SIZE,
        bold: bool = False,
        color: str = "#1c1c1c",
        after: float = 0.08,
    ) -> None:
        scale = size / SIZE
        lines = wrapped(text, WIDTH / (LETTER * scale * (1.08 if bold else 1.0)))
        for line in lines:
            self._room(LINE * scale)
            self._put(MARGIN, line, size=size, bold=bold, color=color)
            self._at += LINE * scale
        self._at += after

    def heading(self, text: str, following: float) -> None:
        """Add a heading; `following` is the height (in) that must fit on the same page."""
        self._room(0.6 + following)
        self._at += 0.15
        self._rule("#cccccc")
        self._at += 0.1
        self.text(text, size=11.0, bold=True)

    def table(self, table: Table) -> None:
        widths = table.widths
        lefts = [MARGIN + WIDTH * sum(widths[:k]) for k in range(len(widths))]
        room = [WIDTH * width / LETTER - 1.5 for width in widths]
        self._room(4 * LINE)
        if table.title:
            self.text(table.title, bold=True, after=0.02)

        def head() -> None:
            for k, name in enumerate(table.head):
                self._cell(lefts[k], WIDTH * widths[k], name, k in table.numeric, "#555555")
            self._at += LINE
            self._rule("#999999")
            self._at += 0.05

        head()
        for row in table.rows:
            cells = [wrapped(str(text), room[k]) for k, text in enumerate(row)]
            height = LINE * max(len(lines) for lines in cells)
            if self._at + height > PAGE[1] - BOTTOM:
                self._next()
                head()
            top = self._at
            for k, lines in enumerate(cells):
                self._at = top
                color = "#8c2d04" if row[k] in LOUD else "#1c1c1c"
                for line in lines:
                    self._cell(lefts[k], WIDTH * widths[k], line, k in table.numeric, color)
                    self._at += LINE
            self._at = top + height
        self._at += 0.18

    def picture(self, picture: Picture, number: int) -> None:
        self._room(_height(picture))
        from matplotlib.artist import Artist

        below = PAGE[1] - self._at - picture.height
        figure = picture.figure
        figure.patch.set_visible(False)
        figure.bbox_inches.bounds = MARGIN, below, WIDTH, picture.height

        def draw(renderer: Any) -> None:
            page, renderer.figure = renderer.figure, figure  # whose dpi change for bitmaps
            figure.draw(renderer)
            renderer.figure = page

        artist: Any = Artist()
        artist.draw = draw
        self._figure.add_artist(artist)
        self._at += picture.height + 0.05
        self.text(f"{number}. {picture.title}. {picture.caption}", color="#444444", after=0.2)

    # ------------------------------------------------------------------ inside
    def _room(self, height: float) -> None:
        if self._at + height > PAGE[1] - BOTTOM and self._at > TOP:
            self._next()

    def _next(self) -> None:
        self.close()
        self._begin()

    def _begin(self) -> None:
        from matplotlib.figure import Figure

        self._figure = Figure(figsize=PAGE)
        self._number += 1
        self._at = PAGE[1] - 0.45
        self._put(MARGIN, self._title[:90], size=7.0, color="#777777")
        self._put(PAGE[0] - MARGIN, str(self._number), size=7.0, color="#777777", right=True)
        self._at = TOP

    def _cell(self, left: float, width: float, text: str, numeric: bool, color: str) -> None:
        at = left + width - 0.12 if numeric else left
        self._put(at, text, color=color, right=numeric)

    def _put(
        self,
        left: float,
        text: str,
        *,
        size: float = SIZE,
        bold: bool = False,
        color: str = "#1c1c1c",
        right: bool = False,
    ) -> None:
        self._figure.text(
            left / PAGE[0],
            1.0 - self._at / PAGE[1],
            text,
            size=size,
            color=color,
            weight="bold" if bold else "normal",
            ha="right" if right else "left",
            va="top",
            parse_math=False,
        )

    def _rule(self, color: str) -> None:
        from matplotlib.lines import Line2D

        at = 1.0 - self._at / PAGE[1]
        ends = [MARGIN / PAGE[0], 1.0 - MARGIN / PAGE[0]]
        self._figure.add_artist(Line2D(ends, [at, at], color=color, linewidth=0.6))


def write_pdf(report: Report, path: Path) -> None:
    """Write the report as a PDF. Raises OSError."""
    import matplotlib
    from matplotlib.backends.backend_pdf import PdfPages

    about = {"Title": report.title, "Creator": GENERATOR, "CreationDate": None}
    with matplotlib.rc_context(STYLE), PdfPages(path, metadata=about) as pdf:
        pages = Pages(pdf, report.title)
        pages.text(report.title, size=15.0, bold=True, after=0.05)
        pages.text(report.subtitle, size=9.0, color="#555555", after=0.12)
        colors = {"passed": "#00563f", "failed": "#8c2d04"}
        verdict = report.verdict if report.verdict in WORDS else ""
        pages.text(WORDS[verdict], size=11.0, bold=True, color=colors.get(verdict, "#444444"))
        pages.text(report.verdict_reason, color="#555555", after=0.12)
        pages.table(Table("", ("", ""), report.facts, "20l 80l"))
        number = 0
        for block, following in zip(report.blocks, [*report.blocks[1:], None], strict=True):
            if isinstance(block, Heading):
                needed = _height(following) if isinstance(following, Picture) else 0.6
                pages.heading(block.text, needed)
            elif isinstance(block, Text):
                sign = "! " if block.warning else ""
                pages.text(sign + block.text, color="#8c2d04" if block.warning else "#1c1c1c")
            elif isinstance(block, Table):
                pages.table(block)
            else:
                number += 1
                pages.picture(block, number)
        pages.close()


def _height(picture: Picture) -> float:
    """Return the height including the caption, in inches."""
    lines = wrapped(f"00. {picture.title}. {picture.caption}", WIDTH / LETTER)
    return picture.height + LINE * len(lines) + 0.1


def wrapped(text: str, letters: float) -> list[str]:
    """Return lines of at most `letters` letters; control characters become spaces."""
    plain = "".join(c if c.isprintable() else " " for c in text)
    return textwrap.wrap(plain, max(4, int(letters)), break_long_words=True) or [""]
