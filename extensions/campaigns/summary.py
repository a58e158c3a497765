"""The summary of the rows: shares, quantiles with intervals, commands that fly rows again."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from extensions.campaigns.analysis import sensitivity
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.plan import COMPILED
from extensions.campaigns.recorded import logs as over_logs
from extensions.campaigns.search import told as search
from extensions.campaigns.settings import Settings
from extensions.campaigns.table import (
    Facts,
    encoded,
    is_verdict,
    judged_metrics,
    metric_columns,
    numbers,
)

if TYPE_CHECKING:
    import pyarrow as pa

Numbers = npt.NDArray[np.float64]
Places = npt.NDArray[np.intp]

CONFIDENCE = 0.95
Z = 1.959963984540054
"""Quantile of the normal distribution at (1 + CONFIDENCE) / 2."""
MOST_CELLS = 2_000
MOST_LISTED = 1_000
"""Cells, and flights that did not pass, in a summary at most."""


def wilson(count: int, of: int) -> tuple[float, float]:
    """Return the interval of a share by Wilson (1927), at CONFIDENCE."""
    if of == 0:
        return 0.0, 1.0
    share, z2 = count / of, Z * Z
    middle = (share + z2 / (2 * of)) / (1 + z2 / of)
    half = Z / (1 + z2 / of) * math.sqrt(share * (1 - share) / of + z2 / (4 * of * of))
    return max(0.0, middle - half), min(1.0, middle + half)


def quantile_interval(ordered: Numbers, q: float) -> tuple[float, float]:
    """Return the bootstrap's percentile interval of a quantile, at CONFIDENCE.

    Args:
        ordered: the values, in order.
    """
    low, high = quantile_places(len(ordered), q)
    return float(ordered[low]), float(ordered[high])


def quantile_places(n: int, q: float) -> tuple[int, int]:
    """Return the places, among n values in order, of the ends of a quantile's interval.

    In the limit of many resamples the bootstrap has a closed form: the number of resampled values
    below an order statistic is binomial, so the ends are order statistics at quantiles of
    Binomial(n, q).
    """
    from scipy.stats import binom

    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = binom.ppf([tail, 1.0 - tail], n, q)
    return min(int(low), n - 1), min(int(high), n - 1)


def command_of(settings: Settings, index: int) -> str:
    """Return the command that flies a row again, or reads its log; "" for a compiled flight."""
    file, plan = settings.file, settings.file.plan
    if plan.experiment == COMPILED:
        return ""
    if plan.logs:
        return _reading(settings, index)
    words = ["quadlab", "fly", file.experiment, "--seed", str(settings.cells.seed(index))]
    words += ["--board", plan.board] if plan.board != "mikrokopter" else []
    words += ["--true-state"] if plan.true_state else []
    words += ["--vehicles", str(plan.vehicles)] if plan.vehicles > 1 else []
    words += ["--plugins", str(file.plugins)] if file.plugins is not None else []
    for one in settings.words(index // plan.seeds):
        words += ["--set", one]
    return shlex.join(words)


def _reading(settings: Settings, index: int) -> str:
    log, settled = settings.log(index // settings.file.plan.seeds)
    if settings.file.plan.experiment == over_logs.EXPLANATION:
        return shlex.join(["quadlab", "log", "info", "--explain", str(log)])
    words = [one for word in settled for one in ("--set", word)]
    return shlex.join(["quadlab", "replay", str(log), *words])


def summarize(folder: CampaignFolder, table: pa.Table | None = None) -> Facts:
    """Return counts, shares, quantiles, cells, and the flights that did not pass."""
    table = folder.table(figures_only=True) if table is None else table
    plan, settings = folder.plan.plan, Settings(folder.plan, folder.cells)
    factors = list(plan.varied)
    metrics = metric_columns(table, factors)
    passed = is_verdict(table, "passed")
    missed = np.flatnonzero(~passed)
    verdicts, reasons = table["verdict"], table["reason"]
    indices = numbers(table, "index")
    found = search.facts(search.outcome(folder, table)) if plan.search else None
    return {
        "folder": str(folder.path),
        "experiment": plan.experiment,
        "flights": folder.flights,
        "rows": table.num_rows,
        "is_whole": folder.is_whole(),
        "cells": folder.cells.number,
        "seeds": plan.seeds,
        "factors": factors,
        "judged": judged_metrics(table),
        "software": folder.record["software"],
        "verdicts": _verdicts(table),
        "metrics": {name: _figures(numbers(table, name)) for name in metrics},
        "search": found,
        "sensitivity": sensitivity.of_metrics(folder.cells, table, judged_metrics(table)),
        "by_cell": _by_cell(folder, table, metrics, passed) if factors else [],
        "not_passed": {
            "count": len(missed),
            "flights": [
                {
                    "index": int(indices[k]),
                    "verdict": verdicts[int(k)].as_py(),
                    "reason": reasons[int(k)].as_py(),
                    "command": command_of(settings, int(indices[k])),
                }
                for k in missed[:MOST_LISTED]
            ],
        },
    }


def _verdicts(table: pa.Table) -> dict[str, dict[str, float]]:
    places, levels = encoded(table["verdict"])
    counts = np.bincount(places, minlength=len(levels)).tolist()
    counted = sorted(zip(levels, counts, strict=True))
    return {name: _share(count, table.num_rows) for name, count in counted if count}


def _share(count: int, of: int) -> dict[str, float]:
    low, high = wilson(count, of)
    return {"count": count, "share": count / of if of else math.nan, "low": low, "high": high}


def _figures(values: Numbers) -> dict[str, float | int | None]:
    """Return quantiles of the values that are finite, and the interval of the median."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return {"count": 0}
    q05, median, q95 = np.quantile(finite, [0.05, 0.5, 0.95]).tolist()
    low, high = quantile_places(len(finite), 0.5)
    finite.partition(sorted({low, high}))
    return {
        "count": len(finite),
        "median": median,
        "low": float(finite[low]),
        "high": float(finite[high]),
        "q05": q05,
        "q95": q95,
        "minimum": float(finite.min()),
        "maximum": float(finite.max()),
    }


def _by_cell(
    folder: CampaignFolder, table: pa.Table, metrics: Sequence[str], passed: npt.NDArray[np.bool_]
) -> list[Facts]:
    cells = numbers(table, "index") // folder.plan.plan.seeds
    starts = np.flatnonzero(np.diff(cells, prepend=-1))[:MOST_CELLS]
    ends = np.append(starts[1:], np.searchsorted(cells, cells[starts[-1]], "right"))
    medians = {name: _medians(numbers(table, name), starts, ends) for name in metrics}
    return [
        {
            "cell": int(cells[start]),
            "factors": folder.cells.factors(int(cells[start])),
            "flights": int(end - start),
            "passed": _share(int(passed[start:end].sum()), int(end - start)),
            "medians": {name: found[k] for name, found in medians.items()},
        }
        for k, (start, end) in enumerate(zip(starts, ends, strict=True))
    ]


def _medians(values: Numbers, starts: Places, ends: Places) -> list[float | None]:
    return [_median(values[start:end]) for start, end in zip(starts, ends, strict=True)]


def _median(values: Numbers) -> float | None:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else None


# ---------------------------------------------------------------------- as text
LISTED = 20
"""Flights that did not pass, and cells, that the text lists."""


def told(summary: Facts) -> list[str]:
    """Return the summary as lines of text."""
    unflown = 0 if summary["is_whole"] else summary["flights"] - summary["rows"]
    head = f"{summary['experiment']}: {summary['rows']} of {summary['flights']} flights"
    lines = [f"{head}, {summary['cells']} cells of {summary['seeds']} seeds"]
    lines += [f"  {unflown} are still to be flown: quadlab campaign resume"] if unflown else []
    for name, one in summary["verdicts"].items():
        share = f"{one['share']:7.2%}   95 %: {one['low']:.2%} to {one['high']:.2%}"
        lines.append(f"  {name.replace('_', ' '):12} {one['count']:8} {share}")
    if summary["metrics"]:
        width = max(map(len, summary["metrics"]))
        lines.append(f"  {'':{width}} {'median':>10} {'95 % of the median':>22} {'5 … 95 %':>22}")
        for name, one in summary["metrics"].items():
            if not one["count"]:
                continue
            between = f"{one['low']:.4g} … {one['high']:.4g}"
            spread = f"{one['q05']:.4g} … {one['q95']:.4g}"
            lines.append(f"  {name:{width}} {one['median']:10.4g} {between:>22} {spread:>22}")
    lines += sensitivity.told(summary["sensitivity"])
    return [*lines, *_told_cells(summary), *_told_missed(summary["not_passed"])]


def _told_cells(summary: Facts) -> list[str]:
    cells = summary["by_cell"]
    if not cells or summary["search"] or summary["sensitivity"]:
        return []
    figures = summary["metrics"]
    judged = [name for name in summary["judged"] if figures[name]["count"]] or list(figures)
    differing = [n for n in judged if figures[n].get("minimum") != figures[n].get("maximum")]
    shown = (differing or judged)[:3]
    heads = [*summary["factors"], "passed", *shown]
    rows = [
        [
            *(_short(value) for value in one["factors"].values()),
            f"{int(one['passed']['count'])}/{one['flights']}",
            *(_short(one["medians"].get(name)) for name in shown),
        ]
        for one in cells[:LISTED]
    ]
    widths = [max(len(row[k]) for row in [heads, *rows]) for k in range(len(heads))]
    lines = [
        "  " + "  ".join(f"{word:>{width}}" for word, width in zip(row, widths, strict=True))
        for row in [heads, *rows]
    ]
    more = len(cells) - LISTED
    return [*lines, *([f"  … {more} more cells: --json"] if more > 0 else [])]


def _short(value: object) -> str:
    return "-" if value is None else f"{value:.5g}" if isinstance(value, float) else str(value)


def _told_missed(missed: Facts) -> list[str]:
    lines: list[str] = []
    for one in missed["flights"][:LISTED]:
        words = one["verdict"].replace("_", " ")
        lines.append(f"flight {one['index']}: {words}{one['reason'] and ': '}{one['reason']}")
        lines += [f"  {one['command']}"] if one["command"] else []
    more = missed["count"] - LISTED
    return [*lines, *([f"… {more} more: --json"] if more > 0 else [])]
