"""The summary of the rows: shares, quantiles with intervals, commands that fly rows again."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from extensions.campaigns.design import seed_of
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.plan import COMPILED
from extensions.campaigns.settings import Settings
from extensions.campaigns.table import Facts, judged_metrics, metric_columns

if TYPE_CHECKING:
    import pyarrow as pa

Numbers = npt.NDArray[np.float64]

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

    In the limit of many resamples it has a closed form: the number of resampled values below an
    order statistic is binomial, so the ends are order statistics at quantiles of Binomial(n, q).

    Args:
        ordered: the values, in order.
    """
    from scipy.stats import binom

    n = len(ordered)
    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = binom.ppf([tail, 1.0 - tail], n, q)
    last = n - 1
    return float(ordered[min(int(low), last)]), float(ordered[min(int(high), last)])


def command_of(settings: Settings, index: int) -> str:
    """Return the command that flies a row again; "" for a compiled flight."""
    file, plan = settings.file, settings.file.plan
    if plan.experiment == COMPILED:
        return ""
    words = ["quadlab", "fly", file.experiment, "--seed", str(seed_of(plan, index))]
    words += ["--board", plan.board] if plan.board != "mikrokopter" else []
    words += ["--true-state"] if plan.true_state else []
    words += ["--plugins", str(file.plugins)] if file.plugins is not None else []
    for one in settings.words(index // plan.seeds):
        words += ["--set", one]
    return shlex.join(words)


def column(table: pa.Table, name: str) -> Numbers:
    """Return a metric, NaN where a flight has none."""
    found: Numbers = table[name].to_numpy(zero_copy_only=False)
    return found


def summarize(folder: CampaignFolder, table: pa.Table | None = None) -> Facts:
    """Return counts, shares, quantiles, cells, and the flights that did not pass."""
    table = folder.table() if table is None else table
    plan, settings = folder.plan.plan, Settings(folder.plan, folder.cells)
    factors = list(plan.factors)
    metrics = metric_columns(table, factors)
    passed = _is(table, "passed")
    missed = np.flatnonzero(~passed)
    indices = table["index"].to_numpy()
    return {
        "folder": str(folder.path),
        "experiment": plan.experiment,
        "flights": folder.flights,
        "rows": table.num_rows,
        "cells": folder.cells.number,
        "seeds": plan.seeds,
        "factors": factors,
        "judged": judged_metrics(table),
        "software": folder.record["software"],
        "verdicts": _verdicts(table),
        "metrics": {name: _figures(column(table, name)) for name in metrics},
        "by_cell": _by_cell(folder, table, metrics, passed) if factors else [],
        "not_passed": {
            "count": len(missed),
            "flights": [
                {
                    "index": int(indices[k]),
                    "verdict": table["verdict"][int(k)].as_py(),
                    "reason": table["reason"][int(k)].as_py(),
                    "command": command_of(settings, int(indices[k])),
                }
                for k in missed[:MOST_LISTED]
            ],
        },
    }


def _is(table: pa.Table, verdict: str) -> npt.NDArray[np.bool_]:
    import pyarrow.compute as pc

    found: npt.NDArray[np.bool_] = pc.equal(table["verdict"], verdict).to_numpy()
    return found


def _verdicts(table: pa.Table) -> dict[str, dict[str, float]]:
    import pyarrow.compute as pc

    counted = {
        one["values"]: one["counts"] for one in pc.value_counts(table["verdict"]).to_pylist()
    }
    return {name: _share(count, table.num_rows) for name, count in sorted(counted.items())}


def _share(count: int, of: int) -> dict[str, float]:
    low, high = wilson(count, of)
    return {"count": count, "share": count / of if of else math.nan, "low": low, "high": high}


def _figures(values: Numbers) -> dict[str, float | int | None]:
    """Return quantiles of the values that are finite, and the interval of the median."""
    ordered = np.sort(values[np.isfinite(values)])
    if not len(ordered):
        return {"count": 0}
    low, high = quantile_interval(ordered, 0.5)
    q05, median, q95 = np.quantile(ordered, [0.05, 0.5, 0.95]).tolist()
    return {
        "count": len(ordered),
        "median": median,
        "low": low,
        "high": high,
        "q05": q05,
        "q95": q95,
        "minimum": float(ordered[0]),
        "maximum": float(ordered[-1]),
    }


def _by_cell(
    folder: CampaignFolder, table: pa.Table, metrics: Sequence[str], passed: npt.NDArray[np.bool_]
) -> list[Facts]:
    cells = table["index"].to_numpy() // folder.plan.plan.seeds
    starts = np.flatnonzero(np.diff(cells, prepend=-1))[:MOST_CELLS]
    ends = np.append(starts[1:], np.searchsorted(cells, cells[starts[-1]], "right"))
    columns = {name: column(table, name) for name in metrics}
    found: list[Facts] = []
    for start, end in zip(starts, ends, strict=True):
        medians = {name: _median(values[start:end]) for name, values in columns.items()}
        found.append(
            {
                "cell": int(cells[start]),
                "factors": folder.cells.factors(int(cells[start])),
                "flights": int(end - start),
                "passed": _share(int(passed[start:end].sum()), int(end - start)),
                "medians": medians,
            }
        )
    return found


def _median(values: Numbers) -> float | None:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else None


# ---------------------------------------------------------------------- as text
LISTED = 20
"""Flights that did not pass, and cells, that the text lists."""


def told(summary: Facts) -> list[str]:
    """Return the summary as lines of text."""
    unflown = summary["flights"] - summary["rows"]
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
    return [*lines, *_told_cells(summary), *_told_missed(summary["not_passed"])]


def _told_cells(summary: Facts) -> list[str]:
    cells = summary["by_cell"]
    if not cells:
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
