"""Routes below /api/campaigns: the campaigns of the data folder, their figures and rows."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from fastapi import FastAPI

from console.catalogue.search import RunSearch
from extensions.campaigns.again import FlyingAgain, has_logs
from extensions.campaigns.beginning import RECORD
from extensions.campaigns.compare import compare
from extensions.campaigns.distributions import ecdf, heat_map
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.recorded.trends import GROUPS, recorded, trends
from extensions.campaigns.settings import Settings
from extensions.campaigns.summary import command_of, summarize
from extensions.campaigns.table import Facts, figures, is_verdict, metric_columns, numbers
from quadrotor.errors import QuadlabError, UsageError
from quadrotor.json_object import JsonObject
from web.access.requester import Operator
from web.feature import Feature
from web.runs.routes import Nanoseconds, Text

if TYPE_CHECKING:
    import pyarrow as pa

    from web.vehicle_context import VehicleContext

FOLDER = "campaigns"
"""Folder of the data folder with campaigns that the page shows."""
LISTED = 50
"""Rows that a page lists."""


def add_campaigns(app: FastAPI, context: VehicleContext) -> None:
    place = context.catalogue.folder.parent / FOLDER

    @app.get("/api/campaigns")
    def campaigns() -> JsonObject:
        """Return the campaigns in the folder `campaigns` of the data folder, newest first."""
        found = sorted(_found(place).values(), key=_begun, reverse=True)
        return {"folder": str(place), "campaigns": [_entry(path) for path in found]}

    @app.get("/api/campaigns/{name}")
    def one(name: str, metric: str = "", x: str = "", y: str = "") -> JsonObject:
        """Return shares, the distribution of a metric, its medians over two factors, and the rows
        that did not pass or have the largest values.
        """
        folder = _folder(place, name)
        table = _table(folder)
        if table is None:
            return {**_entry(folder.path), "metrics": [], "list": []}
        return {**_entry(folder.path), **_shown(folder, table, metric, x, y)}

    @app.get("/api/campaigns/{name}/against/{other}")
    def against(name: str, other: str) -> JsonObject:
        """Return the paired differences of two campaigns: the first one minus the other."""
        return compare(_folder(place, other), _folder(place, name))

    flying = FlyingAgain(context.catalogue)
    context.closing.callback(flying.stop)

    @app.post("/api/campaigns/{name}/flights/{index}")
    def again(name: str, index: int, _: Operator) -> JsonObject:
        """Fly a row again with its log, which becomes a run; return the state of this."""
        return flying.ask(_folder(place, name), index).as_json()


def _add_trends(app: FastAPI, context: VehicleContext) -> None:
    catalogue = context.catalogue
    place = catalogue.folder.parent / FOLDER

    @app.get("/api/trends")
    def trend(
        words: Text = "",
        tag: Text = "",
        vehicle: Text = "",
        since_ns: Nanoseconds = 0,
        until_ns: Nanoseconds = 0,
        metric: Text = "",
        by: Text = "all",
    ) -> JsonObject:
        """Return a figure of the runs that are found over time, for each group."""
        if by not in GROUPS:
            raise UsageError(f"by = {by!r:.40}: allowed are {', '.join(GROUPS)}")
        search = RunSearch(words, tag, vehicle, since_ns, until_ns)
        return trends(recorded(catalogue, search, place), metric, by)


def _found(place: Path) -> dict[str, Path]:
    return {path.parent.name: path.parent for path in place.glob(f"*/{RECORD}")}


def _begun(path: Path) -> float:
    return (path / RECORD).stat().st_mtime


def _folder(place: Path, name: str) -> CampaignFolder:
    found = _found(place).get(name)
    if found is None:
        raise UsageError(f"there is no campaign {name!r} in {place}")
    return CampaignFolder(found)


def _entry(path: Path) -> Facts:
    try:
        folder = CampaignFolder(path)
        return {
            "name": path.name,
            "experiment": folder.record["experiment"],
            "flights": folder.flights,
            "rows": folder.count(),
            "running": folder.is_running,
            "problem": "",
        }
    except QuadlabError as error:
        return {"name": path.name, "flights": 0, "rows": 0, "problem": str(error)}


def _table(folder: CampaignFolder) -> pa.Table | None:
    factors = folder.plan.plan.varied

    def table(parts: list[Path]) -> pa.Table | None:
        state = tuple((str(part), part.stat().st_mtime_ns) for part in parts)
        return _read(state, factors) if state else None

    return folder.read_files(table)


@lru_cache(maxsize=2)
def _read(parts: tuple[tuple[str, int], ...], factors: tuple[str, ...]) -> pa.Table:
    paths = [Path(path) for path, _ in parts]
    return figures(paths, factors, paths[0].parent)


def _shown(folder: CampaignFolder, table: pa.Table, metric: str, x: str, y: str) -> Facts:
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
        "flies_again": has_logs(folder),
        "list": _listed(folder, table, metric),
    }


def _listed(folder: CampaignFolder, table: pa.Table, metric: str) -> list[Facts]:
    """Return the rows that did not pass, then those with the largest values."""
    settings = Settings(folder.plan, folder.cells)
    values = numbers(table, metric) if metric else np.full(table.num_rows, np.nan)
    passed = is_verdict(table, "passed")
    order = np.lexsort((-np.nan_to_num(values, nan=-np.inf), passed))[:LISTED]
    indices = numbers(table, "index")
    verdicts, reasons = table["verdict"], table["reason"]
    return [
        {
            "index": int(indices[k]),
            "verdict": verdicts[int(k)].as_py(),
            "reason": reasons[int(k)].as_py(),
            "value": float(values[k]) if np.isfinite(values[k]) else None,
            "command": command_of(settings, int(indices[k])),
        }
        for k in order
    ]


FEATURE = Feature(add_campaigns)
TRENDS = Feature(_add_trends)
