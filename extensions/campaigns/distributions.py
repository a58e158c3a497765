"""Curves and maps of a metric over the rows of a campaign, small enough for a page."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from extensions.campaigns.design import Cells
from extensions.campaigns.plan import SAMPLED
from extensions.campaigns.summary import Numbers, quantile_interval
from extensions.campaigns.table import Facts, encoded, numbers

if TYPE_CHECKING:
    import pyarrow as pa

POINTS = 200
"""Points of a curve at most."""
BINS = 10
"""Bins of a factor of a sampled design."""
MOST_LEVELS = 40
"""Values of a factor that a map shows at most."""


def ecdf(values: Numbers) -> Facts:
    """Return the share of the flights below each value, and the median with its interval."""
    ordered = np.sort(values[np.isfinite(values)])
    if not len(ordered):
        return {"values": [], "shares": []}
    places = np.unique(np.linspace(0, len(ordered) - 1, POINTS).round().astype(int))
    return {
        "values": ordered[places].tolist(),
        "shares": ((places + 1) / len(ordered)).tolist(),
        "median": float(np.median(ordered)),
        "interval": quantile_interval(ordered, 0.5),
    }


def heat_map(cells: Cells, table: pa.Table, metric: str, x: str, y: str) -> Facts:
    """Return the median of a metric for each pair of values of two factors, NaN as None.

    Args:
        y: "" for a map with one line.
    """
    values = numbers(table, metric)
    across, x_labels = levels_of(cells, table, x)
    down, y_labels = levels_of(cells, table, y) if y else (np.zeros(len(values), int), [""])
    medians: list[list[float | None]] = [[None] * len(x_labels) for _ in y_labels]
    keep = np.isfinite(values)
    place = (down * len(x_labels) + across)[keep]
    order = np.argsort(place, kind="stable")
    place, ordered = place[order], values[keep][order]
    starts = np.flatnonzero(np.diff(place, prepend=-1))
    for start, end in zip(starts, [*starts[1:], len(place)], strict=True):
        row, k = divmod(int(place[start]), len(x_labels))
        medians[row][k] = float(np.median(ordered[start:end]))
    return {"x": x_labels, "y": y_labels, "medians": medians}


def levels_of(cells: Cells, table: pa.Table, name: str) -> tuple[npt.NDArray[np.intp], list[str]]:
    """Return for each row the number of its level of a factor, and the levels' labels."""
    import pyarrow as pa

    column = table[name]
    if cells.plan.design in SAMPLED and pa.types.is_floating(column.type):
        values = numbers(table, name)
        edges = np.quantile(values, np.linspace(0.0, 1.0, BINS + 1))
        if len(np.unique(edges)) == len(edges):
            places = np.clip(np.searchsorted(edges, values, "right") - 1, 0, BINS - 1)
            return places, [f"{low:.3g} … {high:.3g}" for low, high in pairwise(edges)]
    codes, levels = encoded(column)
    order = sorted(range(len(levels)), key=lambda k: levels[k])
    rank = np.empty(len(levels), np.intp)
    rank[order] = np.arange(len(levels))
    places = rank[codes]
    labels = [_label(levels[k]) for k in order]
    return np.minimum(places, MOST_LEVELS - 1), labels[:MOST_LEVELS]


def _label(level: object) -> str:
    return f"{level:.4g}" if isinstance(level, float) else str(level)
