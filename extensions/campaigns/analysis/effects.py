"""Main effects: the median of a metric at each level of a factor, over all others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

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
