"""The report of a campaign: one HTML file, and its figures as files for a paper."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from console.atomic_file import replacing
from console.plots import STYLE, require_matplotlib
from console.reports.content import Block, Heading, Picture, Report, Table, Text
from extensions.campaigns.analysis.figures import pictures
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.search import told as search
from extensions.campaigns.summary import summarize
from extensions.campaigns.table import Facts
from quadrotor.errors import StorageError, UsageError, os_errors
from quadrotor.extension import Function
from quadrotor.extensions import registry

if TYPE_CHECKING:
    import pyarrow as pa

SHOWN = 3
"""Metrics in the figure of distributions at most."""
MOST_ROWS = 40
"""Rows of a table at most."""
MARK = b'content="quadlab '
"""A mark in every page that quadlab writes, so that no other file is overwritten."""


def write_report(folder: CampaignFolder, place: Path) -> None:
    """Write the report as one HTML file; an earlier one is replaced.

    Raises UsageError without the extension reports, StorageError.
    """
    door = registry().offers(Function).get("report_page")
    if door is None:
        raise UsageError("--report needs the extension reports, which is not installed")
    with os_errors(lambda why: f"--report {place} cannot be written ({why})"):
        if place.exists() and MARK not in place.read_bytes()[:2000]:
            raise StorageError(f"--report {place} exists and is no report; give another file")
        render: Any = door.load()
        with replacing(place) as new:
            new.write_text("".join(render(content(folder))))


def write_figures(folder: CampaignFolder, place: Path) -> list[Path]:
    """Write each figure as SVG and PDF, fonts embedded. Raises StorageError."""
    require_matplotlib("--figures")
    import matplotlib

    table = folder.table(figures_only=True)
    written = []
    with os_errors(lambda why: f"--figures {place} cannot be written ({why})"):
        place.mkdir(parents=True, exist_ok=True)
        # As outlines in SVG, as TrueType in PDF: neither asks the reader's computer for a font.
        with matplotlib.rc_context({**STYLE, "svg.fonttype": "path", "pdf.fonttype": 42}):
            for picture in _pictures(folder, table, summarize(folder, table)):
                name = picture.title.lower().replace(" ", "_")
                for kind, about in (("svg", {"Date": None}), ("pdf", {"CreationDate": None})):
                    file = place / f"{name}.{kind}"
                    picture.figure.savefig(file, format=kind, metadata=about)
                    written.append(file)
    return written


def content(folder: CampaignFolder) -> Report:
    """Return the content of the report."""
    require_matplotlib("--report")
    table = folder.table(figures_only=True)
    summary = summarize(folder, table)
    plan = folder.plan.plan
    facts = [
        ("flights", f"{summary['rows']} of {summary['flights']}"),
        ("design", f"{summary['cells']} cells ({plan.design}), {plan.seeds} seeds each"),
        ("seed", str(plan.seed)),
        ("quadlab", " ".join(summary["software"].values())),
        ("computer", folder.record["machine"]["host"]),
    ]
    facts += [(name, str(value)) for name, value in plan.fixed.items()]
    blocks: list[Block] = [Heading("Flights"), _verdicts(summary), _metrics(summary)]
    if plan.search is not None:
        lines = search.told(search.outcome(folder, table))
        blocks += [Heading("Search"), *(Text(line.strip()) for line in lines)]
    blocks += [_sensitivity(name, rows) for name, rows in summary["sensitivity"].items()]
    blocks += [Heading("Figures"), *_pictures(folder, table, summary)]
    if summary["not_passed"]["count"]:
        blocks += [Heading("Flights that did not pass"), _missed(summary["not_passed"])]
    blocks += [Heading("Plan"), *(Text(line) for line in folder.plan.text.splitlines() if line)]
    title = f"Campaign {folder.path.resolve().name}"
    return Report(title, plan.experiment, "", "a campaign has shares, no verdict", facts, blocks)


def _pictures(folder: CampaignFolder, table: pa.Table, summary: Facts) -> list[Picture]:
    plan = folder.plan.plan
    figures = summary["metrics"]
    judged = [name for name in summary["judged"] if figures[name]["count"]]
    aims = [name for name in (plan.search.aims if plan.search else []) if name in figures]
    chosen = list(dict.fromkeys([*aims, *judged])) or [n for n in figures if figures[n]["count"]]
    found = search.outcome(folder, table) if plan.search else None
    return pictures(folder.cells, table, chosen[:SHOWN], found)


def _verdicts(summary: Facts) -> Table:
    rows = [
        [name.replace("_", " "), str(one["count"]), f"{one['share']:.2%}", _between(one, ".2%")]
        for name, one in summary["verdicts"].items()
    ]
    return Table("", ["verdict", "flights", "share", "95 % (Wilson)"], rows, "30l 20r 20r 30r")


def _metrics(summary: Facts) -> Table:
    rows = [
        [
            name,
            f"{one['median']:.4g}",
            _between(one, ".4g"),
            f"{one['q05']:.4g} … {one['q95']:.4g}",
            f"{one['maximum']:.4g}",
        ]
        for name, one in summary["metrics"].items()
        if one["count"]
    ]
    head = ["metric", "median", "95 % of the median", "5 … 95 %", "largest"]
    return Table("", head, rows, "28l 14r 22r 22r 14r")


def _between(one: Facts, kind: str) -> str:
    return f"{one['low']:{kind}} … {one['high']:{kind}}"


def _sensitivity(metric: str, rows: Sequence[Facts]) -> Table:
    cells = [
        [
            one["factor"],
            f"{one['first']:.3f} ± {one['first_95']:.3f}",
            f"{one['total']:.3f} ± {one['total_95']:.3f}",
        ]
        for one in rows
    ]
    title = f"Sobol' indices of {metric}"
    return Table(title, ["factor", "first order", "total"], cells, "50l 25r 25r")


def _missed(missed: Facts) -> Table:
    rows = [
        [str(one["index"]), one["verdict"].replace("_", " "), one["reason"], one["command"]]
        for one in missed["flights"][:MOST_ROWS]
    ]
    title = f"{min(MOST_ROWS, missed['count'])} of {missed['count']}"
    return Table(title, ["flight", "verdict", "reason", "command"], rows, "8r 12l 30l 50l")
