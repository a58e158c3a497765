"""The figures of one campaign as the page shows them: shares, one metric, and single rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from extensions.campaigns.again import has_logs
from extensions.campaigns.analysis.effects import chosen_flights, main_effect, numeric
from extensions.campaigns.distributions import ecdf, heat_map
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.search import told as search
from extensions.campaigns.settings import Settings
from extensions.campaigns.summary import command_of, summarize
from extensions.campaigns.table import Facts, is_verdict, metric_columns, numbers

if TYPE_CHECKING:
    import pyarrow as pa

LISTED = 50
"""Rows in the list at most."""
MOST_POINTS = 300
"""Flights that are drawn one by one at most."""
MOST_FACTORS = 5
"""Factors that are drawn at most."""


def shown(folder: CampaignFolder, table: pa.Table, metric: str, x: str, y: str) -> Facts:
    """Return the figures of a metric, by default of the first one that is an error.

    Args:
        metric, x, y: the metric, and the factors of the map; "" for a choice that fits.
    """
    factors = list(folder.plan.plan.varied)
    metrics = metric_columns(table, factors)
    summary = summarize(folder, table)
    judged = [name for name in summary["judged"] if "rms" in name] or summary["judged"] or metrics
    metric = metric if metric in metrics else (judged[0] if judged else "")
    x = x if x in factors else (factors[0] if factors else "")
    others = [name for name in factors if name != x]
    y = y if y in others else (others[0] if others else "")
    return {
        "verdicts": summary["verdicts"],
        "metrics": metrics,
        "metric": metric,
        "factors": factors,
        "x": x,
        "y": y,
        "ecdf": ecdf(numbers(table, metric)) if metric else None,
        "heat": heat_map(folder.cells, table, metric, x, y) if metric and x else None,
        "effects": _effects(folder, table, metric) if metric else [],
        "points": _points(table, factors, metric) if metric else None,
        "sensitivity": summary["sensitivity"].get(metric, []),
        "search": _searched(folder, table),
        "flies_again": has_logs(folder),
        "list": _listed(folder, table, metric),
    }


def _effects(folder: CampaignFolder, table: pa.Table, metric: str) -> list[Facts]:
    plan = folder.plan.plan
    names = [] if plan.search else plan.varied[:MOST_FACTORS]
    return [main_effect(folder.cells, table, metric, name) for name in names]


def _points(table: pa.Table, factors: list[str], metric: str) -> Facts | None:
    """Return evenly chosen flights: their indices, and each one's factors and metric."""
    names = numeric(table, factors)[:MOST_FACTORS]
    if not names:
        return None
    rows, values = chosen_flights(table, [*names, metric], MOST_POINTS)
    indices = numbers(table, "index")[rows].tolist()
    return {"names": [*names, metric], "indices": indices, "values": values.tolist()}


def _searched(folder: CampaignFolder, table: pa.Table) -> Facts | None:
    if folder.plan.plan.search is None:
        return None
    found = search.outcome(folder, table)
    return {**search.facts(found), "told": [line.strip() for line in search.told(found)]}


def _listed(folder: CampaignFolder, table: pa.Table, metric: str) -> list[Facts]:
    """Return the rows that did not pass, then those with the largest values."""
    values = numbers(table, metric) if metric else np.full(table.num_rows, np.nan)
    passed = is_verdict(table, "passed")
    order = np.lexsort((-np.nan_to_num(values, nan=-np.inf), passed))[:LISTED]
    return _rows(folder, table, order.tolist(), metric)


def flight(folder: CampaignFolder, table: pa.Table, index: int, metric: str) -> Facts | None:
    """Return one row, None if it is not flown yet."""
    place = np.flatnonzero(numbers(table, "index") == index).tolist()
    return _rows(folder, table, place, metric)[0] if place else None


def _rows(folder: CampaignFolder, table: pa.Table, places: list[int], metric: str) -> list[Facts]:
    settings = Settings(folder.plan, folder.cells)
    values = numbers(table, metric) if metric else np.full(table.num_rows, np.nan)
    indices = numbers(table, "index")
    verdicts, reasons = table["verdict"], table["reason"]
    return [
        {
            "index": int(indices[k]),
            "verdict": verdicts[k].as_py(),
            "reason": reasons[k].as_py(),
            "value": float(values[k]) if np.isfinite(values[k]) else None,
            "command": command_of(settings, int(indices[k])),
        }
        for k in places
    ]
