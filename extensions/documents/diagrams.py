"""Flow charts of the documents as SVG: git hosts draw the same text with mermaid.

Understood is what the documents use: `flowchart LR`, `subgraph NAME … end`, boxes `id["text"]` and
arrows `a -- text --> b --> c`. Each subgraph is a lane; a box stands one column right of the last
one that leads to it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from html import escape
from typing import Any

LINE, BOX, GAP, CHARACTER = 15, 14, 26, 6.8
"""Heights of a line and of a box without its lines, gap between rows, width of a letter, in px."""
BETWEEN = 24
"""Least width between two columns; texts of arrows make it wider."""
LEFT = 96
"""Width of the lanes' names."""
NODE = re.compile(r'\s*(\w+)(?:\["?([^"\]]*)"?\])?\s*')
ARROW = re.compile(r'(?:--\s+"?([^"]*?)"?\s+)?-->')
STYLE = (
    ".lane{fill:none;stroke:currentColor;stroke-opacity:.25}"
    ".box{fill:var(--md-code-bg-color,#f5f5f5);stroke:currentColor;stroke-opacity:.45}"
    ".arrow{fill:none;stroke:currentColor;stroke-opacity:.6;stroke-width:1.3}"
    "text{fill:currentColor;font:12px sans-serif;text-anchor:middle}"
    ".said{font-size:11px;fill-opacity:.8;paint-order:stroke;"
    "stroke:var(--md-default-bg-color,#fff);stroke-width:5px}"
    ".name{text-anchor:start;font-weight:bold}"
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
    """Read a flow chart. Raises ValueError for a line that is none of those understood."""
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
    chart = read(text)
    column = chart.columns()
    count = max(column.values()) + 1
    inside = [0.0] * count  # widths of the columns, and of the gaps before them
    before = [float(BETWEEN)] * count
    for box, lines in chart.lines.items():
        inside[column[box]] = max(inside[column[box]], CHARACTER * max(map(len, lines)) + 16)
    for begin, end, said in chart.arrows:
        if said and column[end] > column[begin]:
            is_level = chart.lanes[begin] == chart.lanes[end]
            width = CHARACTER * (0.92 if is_level else 0.5) * max(map(len, said)) + BETWEEN
            before[column[end]] = max(before[column[end]], width)
    before[0] = 0.0
    left = [LEFT + sum(before[: k + 1]) + sum(inside[:k]) for k in range(count)]

    top, bands = 8.0, list[str]()
    centre: dict[str, tuple[float, float]] = {}
    width = left[-1] + inside[-1] + 12
    for lane in dict.fromkeys(chart.lanes.values()):
        rows: dict[int, int] = {}
        boxes = [box for box in chart.lines if chart.lanes[box] == lane]
        tallest = BOX + LINE * max(len(chart.lines[box]) for box in boxes)
        for box in boxes:
            k = column[box]
            row = rows[k] = rows.get(k, -1) + 1
            y = top + GAP / 2 + tallest / 2 + row * (tallest + GAP / 2)
            centre[box] = (left[k] + inside[k] / 2, y)
        height = GAP + (max(rows.values()) + 1) * (tallest + GAP / 2) - GAP / 2
        if lane:
            bands.append(
                f'<rect class="lane" x="2" y="{top:g}" width="{width - 4:g}" height="{height:g}" '
                f'rx="6"/><text class="name" x="12" y="{top + 20:g}">{escape(lane)}</text>'
            )
        top += height + 8

    def half(box: str) -> tuple[float, float]:
        lines = chart.lines[box]
        return CHARACTER * max(map(len, lines)) / 2 + 7, (BOX + LINE * len(lines)) / 2

    arrows, words = list[str](), list[str]()
    for begin, end, said in chart.arrows:
        (x1, y1), (x2, y2) = centre[begin], centre[end]
        if column[end] > column[begin]:
            x1, x2 = x1 + half(begin)[0], x2 - half(end)[0]
            bend = min(60.0, (x2 - x1) / 2)
            curve = f"C{x1 + bend:g} {y1:g} {x2 - bend:g} {y2:g} {x2 - 5:g} {y2:g}"
            x, y = x2 - before[column[end]] / 2, (y1 + 3 * y2) / 4
        else:  # back, below all lanes
            top += 22
            curve = f"V{top - 12:g}H{x2:g}V{y2 + half(end)[1] + 5:g}"
            x, y = (x1 + x2) / 2, top - 12
        arrows.append(f'<path class="arrow" d="M{x1:g} {y1:g}{curve}" marker-end="url(#tip)"/>')
        words += _text(said, x, y - 3 if y1 == y2 and column[end] > column[begin] else y, "said")
    boxes = []
    for box, (x, y) in centre.items():
        w, h = half(box)
        boxes.append(
            f'<rect class="box" x="{x - w:g}" y="{y - h:g}" width="{2 * w:g}" height="{2 * h:g}" '
            'rx="4"/>'
        )
        boxes += _text(chart.lines[box], x, y)
    tip = (
        '<marker id="tip" viewBox="0 0 8 8" refX="3" refY="4" markerWidth="7" markerHeight="7" '
        'orient="auto-start-reverse"><path d="M0 0L8 4L0 8z" fill="currentColor"/></marker>'
    )
    told = f"flow chart through {', '.join(filter(None, dict.fromkeys(chart.lanes.values())))}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {top:g}" '
        f'style="min-width:{0.8 * width:g}px;width:100%" role="img" '
        f'aria-label="{escape(told)}"><style>{STYLE}</style>'
        f"<defs>{tip}</defs>{''.join([*bands, *arrows, *boxes, *words])}</svg>"
    )


def _text(lines: list[str], x: float, y: float, kind: str = "") -> list[str]:
    """Return lines of text about a point."""
    first = y + 4 - LINE * (len(lines) - 1) / 2
    return [
        f'<text class="{kind}" x="{x:g}" y="{first + LINE * k:g}">{escape(line)}</text>'
        for k, line in enumerate(lines)
    ]


def fence(source: str, *_: Any, **__: Any) -> str:
    """Return what pymdownx.superfences puts in place of a block of mermaid."""
    return f'<div style="overflow-x:auto;margin:1em 0">{svg(source)}</div>'
