"""The tables of the arena, as Markdown, and their place in a page."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

from control.parameters import GEOMETRIC
from extensions.laws.arena.results import FIGURES, NEAR, Cell, as_json, lines_of, standings
from quadrotor.errors import UsageError, os_errors

BEGIN, END = "<!-- quadlab arena begins -->", "<!-- quadlab arena ends -->"


def errors_table(cells: Sequence[Cell]) -> list[str]:
    """Return the median error (mm) with its interval; the smallest of a line is bold."""
    names = list(dict.fromkeys(one.entry for one in cells))
    lines = [_row("course", "disturbance", *names), _row("---", "---", *("--:" for _ in names))]
    for row in lines_of(cells):
        best = min(one.median for one in row)
        lines.append(_row(row[0].course, row[0].disturbance, *(_told(o, best) for o in row)))
    return lines


def ratios_table(cells: Sequence[Cell]) -> list[str]:
    """Return the error over that of the geometric law, seed by seed, with its interval."""
    names = [name for name in dict.fromkeys(one.entry for one in cells) if name != GEOMETRIC]
    lines = [_row("course", "disturbance", *names), _row("---", "---", *("--:" for _ in names))]
    for row in lines_of(cells):
        base = next(one for one in row if one.entry == GEOMETRIC)
        told = []
        for one in row:
            if one is not base:
                ratio, low, high = one.ratio_to(base)
                is_known = math.isfinite(ratio)
                told.append(f"{ratio:.2f} ({low:.2f} … {high:.2f})" if is_known else "crashes")
        lines.append(_row(row[0].course, row[0].disturbance, *told))
    return lines


@dataclass(frozen=True)
class Facts:
    """The tolerated latency of an entry, s, and the time of its tick, s."""

    law: str
    latency: float
    tick: float


def facts_table(cells: Sequence[Cell], facts: Sequence[Facts]) -> list[str]:
    """Return how often each law is the first, or near it, among all laws and among those that
    tolerate at least as much latency, with this latency and the time of its tick.
    """
    base = next((one.tick for one in facts if one.law == GEOMETRIC), math.nan)
    near = f"within {100 * (NEAR - 1):.0f} %"
    counted = "law", "first", near, f"{near}, at its latency", "crashed"
    head = *counted, "tolerated latency", "effort", "saturated", "tick"
    lines = [_row(*head, "of the geometric law's"), _row("---", *("--:" for _ in head))]
    ranks = {one.law: one for one in standings(cells)}
    for one in facts:
        rivals = {other.law for other in facts if other.latency >= one.latency}
        equal = standings([cell for cell in cells if cell.entry in rivals])
        rank, among = ranks[one.law], next(found for found in equal if found.law == one.law)
        counts = f"{rank.first} of {rank.lines}", f"{rank.near} of {rank.lines}"
        share, lost = f"{among.near} of {among.lines}", f"{rank.crashed} of {rank.flights}"
        use = _use_of([cell for cell in cells if cell.entry == one.law])
        latency, tick = f"{1e3 * one.latency:.0f} ms", f"{1e6 * one.tick:.1f} µs"
        cost = latency, *use, tick, f"{one.tick / base:.2f}"
        lines.append(_row(one.law, *counts, share, lost, *cost))
    return lines


def _use_of(cells: Sequence[Cell]) -> tuple[str, str]:
    """Return the mean effort and saturation of the lines that a law flies."""
    flown = [one for one in cells if math.isfinite(one.effort)]
    if not flown:
        return "–", "–"
    effort, saturated = fmean(o.effort for o in flown), fmean(o.saturated for o in flown)
    return f"{effort:.0f} N/s", f"{100 * saturated:.1f} %"


def _told(cell: Cell, best: float) -> str:
    failed = f", {cell.failures} crashed" if cell.failures else ""
    if not math.isfinite(cell.median):
        return f"{cell.failures} of {len(cell.rms)} crashed"
    low, high = cell.interval()
    value = f"{1e3 * cell.median:.1f}"
    value = f"**{value}**" if cell.median == best else value
    return f"{value} ({1e3 * low:.1f} … {1e3 * high:.1f}{failed})"


def _row(*words: str) -> str:
    return f"| {' | '.join(words)} |"


def as_csv(cells: Sequence[Cell]) -> str:
    """Return a line for each flight, with the figures of its cell; a crash has no error."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("law", "course", "disturbance", "flight", "position_rms_m", *FIGURES))
    for one in cells:
        of_all = [getattr(one, name) for name in FIGURES.values()]
        for k, rms in enumerate(one.rms.tolist()):
            told = ["" if math.isnan(x) else repr(x) for x in (rms, *of_all)]
            writer.writerow((one.entry, one.course, one.disturbance, k + 1, *told))
    return text.getvalue()


def as_latex(cells: Sequence[Cell]) -> str:
    """Return the table of errors (mm) for LaTeX with the package booktabs."""
    head, _, *rows = errors_table(cells)
    lines = [_latex(head), "\\midrule", *map(_latex, rows)]
    names = len(dict.fromkeys(one.entry for one in cells))
    begin = f"\\begin{{tabular}}{{ll{'r' * names}}}"
    return "\n".join((begin, "\\toprule", *lines, "\\bottomrule", "\\end{tabular}", ""))


def _latex(row: str) -> str:
    cells = re.sub(r"([%_&#])", r"\\\1", row).replace("…", r"\ldots")
    cells = re.sub(r"\*\*(.+?)\*\*", r"\\textbf{\1}", cells)
    return f"{' & '.join(cells.strip('| ').split(' | '))} \\\\"


WRITERS = {".json": as_json, ".csv": as_csv, ".tex": as_latex}
"""The formats of `--out`, by the ending of its name."""


def check_out(path: Path) -> None:
    """Raise UsageError for an ending that no format has."""
    if path.suffix not in WRITERS:
        raise UsageError(f"--out {path}: allowed are {', '.join(WRITERS)}; choose one of them")


def write_out(path: Path, cells: Sequence[Cell]) -> None:
    """Write the flights in the format of the file's ending. Raises StorageError."""
    with os_errors(lambda why: f"--out {path} cannot be written ({why})"):
        path.write_text(WRITERS[path.suffix](cells))


def write_into(page: Path, lines: Sequence[str]) -> None:
    """Replace what is between the marks of a page. Raises UsageError for a page without marks."""
    with os_errors(lambda why: f"the page {page} cannot be changed ({why}); choose another"):
        before, after = _around(page)
        page.write_text("\n".join((before + BEGIN, *lines, END + after)))


def check_page(page: Path) -> None:
    """Check that a page has the marks. Raises UsageError, StorageError."""
    with os_errors(lambda why: f"the page {page} cannot be read ({why}); choose another"):
        _around(page)


def _around(page: Path) -> tuple[str, str]:
    text = page.read_text()
    if BEGIN not in text or END not in text:
        raise UsageError(f"{page} has no lines {BEGIN} and {END}; add them where tables belong")
    return text.partition(BEGIN)[0], text.partition(END)[2]
