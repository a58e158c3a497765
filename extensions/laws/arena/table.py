"""The tables of the arena, as Markdown, and their place in a page."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from control.parameters import GEOMETRIC
from extensions.laws.arena.results import Cell, as_json, lines_of
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


def facts_table(facts: Iterable[tuple[str, float, float]]) -> list[str]:
    """Return the tolerated latency (s) and the time of a tick (s) of each entry."""
    rows = list(facts)
    base = next((tick for name, _, tick in rows if name == GEOMETRIC), math.nan)
    lines = [_row("law", "tolerated latency", "tick", "of the geometric law's")]
    lines.append(_row("---", "--:", "--:", "--:"))
    for name, latency, tick in rows:
        cost = f"{1e6 * tick:.1f} µs", f"{tick / base:.2f}"
        lines.append(_row(name, f"{1e3 * latency:.0f} ms", *cost))
    return lines


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
    """Return a line for each flight; a crash has no error."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("law", "course", "disturbance", "flight", "position_rms_m"))
    for one in cells:
        for k, rms in enumerate(one.rms.tolist()):
            told = "" if math.isnan(rms) else repr(rms)
            writer.writerow((one.entry, one.course, one.disturbance, k + 1, told))
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
