"""Flow charts of the documents as SVG: git hosts draw the same text with mermaid.

Understood is what the documents use: `flowchart LR`, `subgraph NAME … end`, boxes `id["text"]` and
arrows `a -- text --> b --> c`. Each subgraph is a lane; a box stands one column right of the last
one that leads to it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from html import escape

LINE, BOX, GAP, CHARACTER = 15, 14, 26, 6.8
"""Heights of a line and of a box without its lines, gap between rows, width of a letter, in px."""
BETWEEN = 24
"""Least width between two columns; texts of arrows make it wider."""
LEFT = 96
"""Width of the lanes' names."""
NODE = re.compile(r'\s*(\w+)(?:\["?([^"\]]*)"?\])?\s*')
ARROW = re.compile(r'(?:--\s+"?([^"]*?)"?\s+)?-->')
LOOKS = {
    "lane": 'fill="none" stroke="currentColor" stroke-opacity=".25"',
    "box": 'fill="var(--md-code-bg-color,#f5f5f5)" stroke="currentColor" stroke-opacity=".45"',
    "arrow": 'fill="none" stroke="currentColor" stroke-opacity=".6" stroke-width="1.3"',
    "said": (
        'font-size="11" fill-opacity=".8" paint-order="stroke" stroke-width="5" '
        'stroke="var(--md-default-bg-color,#fff)"'
    ),
    "name": 'text-anchor="start" font-weight="bold"',
    "text": "",
}
"""Attributes of each kind of part: the page's security policy forbids styles in a document."""
TEXT = 'fill="currentColor" font-family="sans-serif" font-size="12" text-anchor="middle"'
TIP = (
    '<marker id="tip" viewBox="0 0 8 8" refX="3" refY="4" markerWidth="7" markerHeight="7" '
    'orient="auto-start-reverse"><path d="M0 0L8 4L0 8z" fill="currentColor"/></marker>'
)


@dataclass
class Chart:
    """A flow chart that has been read.

    Attributes:
        lines: text of each box by its id, in lines. lanes: name of each box's lane.
        arrows: from, to, and the text's lines.
    """

    lines: dict[str, list[str]] = field(default_factory=dict)
    lanes: dict[str, str] = field(default_factory=dict)
    arrows: list[tuple[str, str, list[str]]] = field(default_factory=list)

    def columns(self) -> dict[str, int]:
        """Return the column of each box: of an arrow that closes a circle nothing follows."""
        ahead: dict[str, set[str]] = {box: set() for box in self.lines}

        def leads(begin: str, end: str) -> bool:
            return begin == end or any(leads(one, end) for one in ahead[begin])

        for begin, end, _ in self.arrows:
            if not leads(end, begin):
                ahead[begin].add(end)
        found = dict.fromkeys(self.lines, 0)
        for _ in self.lines:
            for begin, ends in ahead.items():
                for end in ends:
                    found[end] = max(found[end], found[begin] + 1)
        return found


def read(text: str) -> Chart:
    """Read a flow chart. Raises ValueError for a line that is not understood."""
    chart, lane = Chart(), ""
    for number, line in enumerate(filter(None, map(str.strip, text.splitlines()))):
        if number == 0 and line == "flowchart LR":
            continue
        if line == "end":
            lane = ""
        elif line.startswith("subgraph "):
            lane = line.removeprefix("subgraph ").strip()
        else:
            _read_arrows(chart, line, lane)
    return chart


def _read_arrows(chart: Chart, line: str, lane: str) -> None:
    before, said, at = "", list[str](), 0
    while at < len(line):
        found = NODE.match(line, at)
        if found is None:
            raise ValueError(f"no box at {line[at:]!r} in {line!r}")
        box, text = found.groups()
        if box not in chart.lines or text:
            chart.lines[box] = (text or box).split("<br>")
            chart.lanes[box] = lane or chart.lanes.get(box, "")
        if before:
            chart.arrows.append((before, box, said))
        before, at = box, found.end()
        if at < len(line):
            arrow = ARROW.match(line, at)
            if arrow is None:
                raise ValueError(f"no arrow at {line[at:]!r} in {line!r}")
            said, at = (arrow[1] or "").split("<br>") if arrow[1] else [], arrow.end()


def svg(text: str) -> str:
    """Return a flow chart as SVG, in the colours of the page around it. Raises ValueError."""
    drawing = _Drawing(read(text))
    bands = [line for lane in drawing.lanes for line in drawing.lane(lane)]
    arrows = [line for arrow in drawing.chart.arrows for line in drawing.arrow(*arrow)]
    boxes = [line for box in drawing.centre for line in drawing.box(box)]
    told = f"flow chart through {', '.join(filter(None, drawing.lanes))}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {drawing.width:g} {drawing.top:g}" '
        f'width="{drawing.width:g}" height="{drawing.top:g}" {TEXT} role="img" '
        f'aria-label="{escape(told)}"><defs>{TIP}</defs>'
        f"{''.join([*bands, *arrows, *boxes])}</svg>"
    )


class _Drawing:
    """A flow chart whose lanes, arrows and boxes are drawn from top to bottom, in this order.

    Attributes:
        top: the first free line below what was drawn, in px.
        centre: of each box that has a place, in px.
    """

    def __init__(self, chart: Chart) -> None:
        self.chart, self.lanes = chart, tuple(dict.fromkeys(chart.lanes.values()))
        self.top, self.centre = 8.0, dict[str, tuple[float, float]]()
        self._column = chart.columns()
        count = max(self._column.values()) + 1
        self._inside = [0.0] * count  # widths of the columns, and of the gaps before them
        self._before = [float(BETWEEN)] * count
        self._widen()
        before, inside = self._before, self._inside
        self._left = [LEFT + sum(before[: k + 1]) + sum(inside[:k]) for k in range(count)]
        self.width = self._left[-1] + inside[-1] + 12

    def _widen(self) -> None:
        """Make the columns as wide as their boxes, and the gaps as the texts in them."""
        chart, column, inside, before = self.chart, self._column, self._inside, self._before
        for box, lines in chart.lines.items():
            inside[column[box]] = max(inside[column[box]], CHARACTER * max(map(len, lines)) + 16)
        for begin, end, said in chart.arrows:
            if said and column[end] > column[begin]:
                is_level = chart.lanes[begin] == chart.lanes[end]
                width = CHARACTER * (0.92 if is_level else 0.5) * max(map(len, said)) + BETWEEN
                before[column[end]] = max(before[column[end]], width)
        before[0] = 0.0

    def lane(self, lane: str) -> list[str]:
        """Give the boxes of a lane their places; return its frame and name."""
        rows: dict[int, int] = {}
        boxes = [box for box in self.chart.lines if self.chart.lanes[box] == lane]
        tallest = BOX + LINE * max(len(self.chart.lines[box]) for box in boxes)
        for box in boxes:
            k = self._column[box]
            row = rows[k] = rows.get(k, -1) + 1
            y = self.top + GAP / 2 + tallest / 2 + row * (tallest + GAP / 2)
            self.centre[box] = (self._left[k] + self._inside[k] / 2, y)
        height = GAP + (max(rows.values()) + 1) * (tallest + GAP / 2) - GAP / 2
        top, self.top = self.top, self.top + height + 8
        if not lane:
            return []
        return [
            f'<rect {_look("lane")} x="2" y="{top:g}" width="{self.width - 4:g}" '
            f'height="{height:g}" rx="6"/>'
            f'<text {_look("name")} x="12" y="{top + 20:g}">{escape(lane)}</text>'
        ]

    def arrow(self, begin: str, end: str, said: list[str]) -> list[str]:
        """Return an arrow and its text; an arrow back goes below all lanes."""
        (x1, y1), (x2, y2) = self.centre[begin], self.centre[end]
        goes_on = self._column[end] > self._column[begin]
        if goes_on:
            x1, x2 = x1 + self._half(begin)[0], x2 - self._half(end)[0]
            bend = min(60.0, (x2 - x1) / 2)
            curve = f"C{x1 + bend:g} {y1:g} {x2 - bend:g} {y2:g} {x2 - 5:g} {y2:g}"
            x, y = x2 - self._before[self._column[end]] / 2, (y1 + 3 * y2) / 4
        else:
            self.top += 22
            curve = f"V{self.top - 12:g}H{x2:g}V{y2 + self._half(end)[1] + 5:g}"
            x, y = (x1 + x2) / 2, self.top - 12
        drawn = f'<path {_look("arrow")} d="M{x1:g} {y1:g}{curve}" marker-end="url(#tip)"/>'
        return [drawn, *_text(said, x, y - 3 if y1 == y2 and goes_on else y, "said")]

    def box(self, box: str) -> list[str]:
        """Return a box with its text."""
        (x, y), (w, h) = self.centre[box], self._half(box)
        frame = (
            f'<rect {_look("box")} x="{x - w:g}" y="{y - h:g}" width="{2 * w:g}" '
            f'height="{2 * h:g}" rx="4"/>'
        )
        return [frame, *_text(self.chart.lines[box], x, y)]

    def _half(self, box: str) -> tuple[float, float]:
        """Return half the width and height of a box."""
        lines = self.chart.lines[box]
        return CHARACTER * max(map(len, lines)) / 2 + 7, (BOX + LINE * len(lines)) / 2


def _look(kind: str) -> str:
    return f'class="{kind}" {LOOKS[kind]}'


def _text(lines: list[str], x: float, y: float, kind: str = "text") -> list[str]:
    """Return lines of text about a point."""
    first = y + 4 - LINE * (len(lines) - 1) / 2
    return [
        f'<text {_look(kind)} x="{x:g}" y="{first + LINE * k:g}">{escape(line)}</text>'
        for k, line in enumerate(lines)
    ]
