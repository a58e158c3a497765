"""Sobol' indices of the factors: the share of a metric's variance that each of them explains.

The cells of the design `saltelli` are those that the estimator of SALib needs; the metric of a cell
is the mean over its seeds, so that noise between seeds counts for little.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from extensions.campaigns.design import Cells
from extensions.campaigns.plan import SALTELLI
from extensions.campaigns.table import Facts, numbers

if TYPE_CHECKING:
    import pyarrow as pa

RESAMPLES = 200
"""Number of samples of the bootstrap that gives the intervals of the indices."""


def of_metrics(cells: Cells, table: pa.Table, metrics: Sequence[str]) -> dict[str, list[Facts]]:
    """Return the indices of the metrics that have some."""
    found = {metric: indices(cells, table, metric) for metric in metrics}
    return {metric: rows for metric, rows in found.items() if rows}


def indices(cells: Cells, table: pa.Table, metric: str) -> list[Facts]:
    """Return the first-order and total index of each factor, with half the 95 % interval.

    An empty list for another design, for cells without the metric, and for one that is constant.
    """
    if cells.plan.design != SALTELLI:
        return []
    means = cell_means(cells, table, metric)
    if not np.isfinite(means).all() or np.ptp(means) == 0.0:
        return []
    from SALib.analyze import sobol

    names = list(cells.plan.factors)
    problem = {"num_vars": len(names), "names": names}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of intervals of a factor without any effect
        found = sobol.analyze(
            problem, means, calc_second_order=False, num_resamples=RESAMPLES, seed=cells.plan.seed
        )
    columns = (found["S1"], found["S1_conf"], found["ST"], found["ST_conf"])
    return [
        {"factor": name, "first": first, "first_95": a, "total": total, "total_95": b}
        for name, first, a, total, b in zip(names, *(c.tolist() for c in columns), strict=True)
    ]


def cell_means(cells: Cells, table: pa.Table, metric: str) -> npt.NDArray[np.float64]:
    """Return the mean of a metric over the flights of each cell, NaN for a cell without any."""
    values = numbers(table, metric)
    cell = numbers(table, "index") // cells.plan.seeds
    finite = np.isfinite(values)
    counts = np.bincount(cell[finite], minlength=cells.number)
    sums = np.bincount(cell[finite], values[finite], minlength=cells.number)
    with np.errstate(invalid="ignore", divide="ignore"):
        found: npt.NDArray[np.float64] = sums / counts
    return found


def told(found: dict[str, list[Facts]]) -> list[str]:
    """Return the indices of each metric as lines of text."""
    lines = []
    for metric, rows in found.items():
        lines.append(f"  Sobol' indices of {metric}: first order, total (95 %)")
        for one in rows:
            first = f"{one['first']:6.3f} ± {one['first_95']:.3f}"
            lines.append(
                f"    {one['factor']:34} {first}   {one['total']:6.3f} ± {one['total_95']:.3f}"
            )
    return lines
