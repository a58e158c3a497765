"""Routes below /api/campaigns: the campaigns of the data folder, their figures and rows."""

from __future__ import annotations

import os
import threading
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from fastapi import FastAPI
from fastapi.responses import FileResponse

from console.catalogue.search import RunSearch
from extensions.campaigns.again import FlyingAgain
from extensions.campaigns.analysis.report import write_report
from extensions.campaigns.analysis.shown import flight, shown
from extensions.campaigns.beginning import RECORD
from extensions.campaigns.compare import compare
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.recorded.trends import GROUPS, recorded, trends
from extensions.campaigns.search.kept import read_trials
from extensions.campaigns.table import Facts, figures
from quadrotor.errors import QuadlabError, UsageError, os_errors
from quadrotor.json_object import JsonObject
from vehicle_link import jobs
from web.access.requester import Operator
from web.experiments.reports import DOCUMENT
from web.feature import Feature
from web.runs.routes import Nanoseconds, Text

if TYPE_CHECKING:
    import pyarrow as pa

    from web.vehicle_context import VehicleContext

FOLDER = "campaigns"
"""Folder of the data folder with campaigns that the page shows."""
REPORT = "report.html"
REPORT_SECONDS = 120.0
"""Longest time of making a report."""


def add_campaigns(app: FastAPI, context: VehicleContext) -> None:
    place = context.catalogue.folder.parent / FOLDER

    @app.get("/api/campaigns")
    def campaigns() -> JsonObject:
        """Return the campaigns in the folder `campaigns` of the data folder, newest first."""
        found = sorted(_found(place).values(), key=_begun, reverse=True)
        return {"folder": str(place), "campaigns": [_entry(path) for path in found]}

    @app.get("/api/campaigns/{name}")
    def one(name: str, metric: str = "", x: str = "", y: str = "") -> JsonObject:
        """Return shares, the figures of a metric, and the rows that did not pass or have the
        largest values.
        """
        folder = _folder(place, name)
        table = _table(folder)
        if table is None:
            return {**_entry(folder.path), "metrics": [], "list": []}
        return {**_entry(folder.path), **shown(folder, table, metric, x, y)}

    @app.get("/api/campaigns/{name}/flights/{index}")
    def row(name: str, index: int, metric: str = "") -> JsonObject:
        """Return a row with the value of a metric, and the command that flies it again."""
        folder = _folder(place, name)
        table = _table(folder)
        found = None if table is None else flight(folder, table, index, metric)
        if found is None:
            raise UsageError(f"flight {index} of {name} has no row")
        return found

    making = threading.Lock()

    @app.get("/api/campaigns/{name}/report")
    def report(name: str) -> FileResponse:
        """Return the report, made again if there are more rows since."""
        folder = _folder(place, name)
        file = folder.path / REPORT
        with making, os_errors(lambda why: f"no report of {name} ({why})"):
            of = folder.rows.stat().st_mtime_ns
            if not file.exists() or file.stat().st_mtime_ns != of:
                jobs.run(write_report, folder, file, seconds=REPORT_SECONDS)
                os.utime(file, ns=(of, of))
        return FileResponse(file, headers={"content-security-policy": DOCUMENT})

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
            "over": read_trials(path).is_over,  # of a search, which needs not all flights
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


FEATURE = Feature(add_campaigns)
TRENDS = Feature(_add_trends)
