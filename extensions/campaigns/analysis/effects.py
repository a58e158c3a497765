"""Main effects of factors, and evenly chosen flights for plots of single ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from extensions.campaigns.design import Cells
from extensions.campaigns.distributions import levels_of
from extensions.campaigns.summary import quantile_interval
from extensions.campaigns.table import Facts, numbers

if TYPE_CHECKING:
    import pyarrow as pa


def main_effect(cells: Cells, table: pa.Table, metric: str, factor: str) -> Facts:
    """Return levels of a factor with the median of a metric and its 95 % interval."""
    values = numbers(table, metric)
    places, labels = levels_of(cells, table, factor)
    found = []
    for k, label in enumerate(labels):
        here = np.sort(values[(places == k) & np.isfinite(values)])
        if len(here):
            low, high = quantile_interval(here, 0.5)
            found.append(
                {"level": label, "median": float(np.median(here)), "low": low, "high": high}
            )
    return {"factor": factor, "levels": found}


def numeric(table: pa.Table, names: Sequence[str]) -> list[str]:
    """Return the names of the columns that hold numbers."""
    import pyarrow as pa

    kinds = (pa.types.is_floating, pa.types.is_integer)
    return [n for n in names if any(one(table.schema.field(n).type) for one in kinds)]


def chosen_flights(
    table: pa.Table, names: Sequence[str], most: int
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.float64]]:
    """Return the rows of evenly chosen flights that have all columns, and these (N, names)."""
    values = np.column_stack([np.asarray(numbers(table, name), float) for name in names])
    rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    rows = rows[np.linspace(0, len(rows) - 1, min(most, len(rows))).round().astype(int)]
    return rows, values[rows]
