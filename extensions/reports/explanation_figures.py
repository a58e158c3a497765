"""The findings of a flight: each claim with a plot of its evidence and a link to the replay."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote, urlencode

from console.evaluation.findings import Finding
from console.plots import COLORS, finish, line, styled, window
from console.reports.content import Block, Heading, Picture, Text
from console.reports.run_log import RunLog
from flight_log.run_folder import RUNS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MARGIN = 3.0
"""Seconds plotted before and after the claimed interval."""


def explanation_blocks(log: RunLog, findings: list[Finding]) -> list[Block]:
    """Return the section, heaviest finding first; one line when there is none."""
    blocks: list[Block] = [Heading("What happened")]
    if not findings:
        return [*blocks, Text("No anomalies found in what was recorded.")]
    return [*blocks, *(_picture(log, one) for one in findings)]


def _picture(log: RunLog, finding: Finding) -> Picture:
    first, last = max(0.0, finding.start - MARGIN), finding.end + MARGIN
    rows = (finding.time >= first) & (finding.time <= last)

    def draw(figure: Figure) -> None:
        axis = figure.subplots()
        line(axis, finding.time[rows], finding.values[rows], color=COLORS[0])
        axis.axhline(finding.limit, color=COLORS[1], linewidth=0.9, linestyle="--", label="limit")
        window(axis, [(finding.start, finding.end)])
        axis.set_xlim(first, min(last, log.duration))
        axis.set_xlabel("s (shaded: what is claimed)")
        finish(axis, finding.label, finding.unit)

    title = finding.kind.replace("_", " ").capitalize()
    return Picture(
        f"{title}, {finding.start:.1f} to {finding.end:.1f} s",
        finding.text,
        f"{finding.label} over time with its limit of {finding.limit:g} {finding.unit}.",
        1.7,
        styled(draw),
        _link(log.path, finding),
    )


def _link(path: Path, finding: Finding) -> str:
    """Return the address of the moment in the replay; empty for a log that is not a
    station's run.
    """
    names = path.resolve().parts
    if RUNS not in names[:-1]:
        return ""
    run_id = names[names.index(RUNS) + 1].removesuffix(".mcap")
    words = {"t": f"{finding.start:.3f}", "w": 10, "s": ",".join(finding.signals)}
    return f"/replay/{quote(run_id)}#{urlencode(words)}"
