"""Reports of runs: an experiment's result, its files, and a report made on request."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from fastapi import FastAPI
from fastapi.responses import FileResponse

from console.runs.report_folders import read_result, report_file
from quadrotor.json_object import JsonObject
from web.access.requester import Operator
from web.feature import Feature
from web.runs.report_making import ReportMaking

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext

SHOWN = {
    ".html": "text/html; charset=utf-8",
    ".png": "image/png",
    ".md": "text/plain; charset=utf-8",
    ".csv": "text/plain; charset=utf-8",
    ".json": "application/json",
    ".pdf": "application/pdf",
}
"""File types that a browser may show; any other file of a report is downloaded."""
DOCUMENT = (
    "sandbox; default-src 'none'; img-src data:; style-src 'unsafe-inline'; font-src data:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
"""Content policy of an HTML report.

The report is self-contained: it runs nothing, fetches nothing and has no origin, so that nothing in
it has the rights of the person who opens it.
"""


def new_feature() -> Feature:
    """Return the feature, whose reports of all vehicles are made one after another."""
    reports = ReportMaking()
    return Feature(partial(add_reports, reports=reports), reports.stop)


def add_reports(app: FastAPI, context: VehicleContext, reports: ReportMaking) -> None:
    """Add the routes below /api/runs/{run_id}/report, and the page /report/{run_id}."""
    catalogue = context.catalogue

    @app.get("/api/runs/{run_id}/report")
    def report(run_id: str) -> JsonObject:
        """Return verdict, figures, options and files of the experiment judged on this run."""
        return read_result(catalogue.resolve(run_id))

    @app.post("/api/runs/{run_id}/report")
    def make(run_id: str, _: Operator) -> JsonObject:
        """Start making the report with figures, again if there is one; return its progress."""
        log = catalogue.resolve(run_id)
        return reports.ask(run_id, log).as_json(log)

    @app.get("/api/runs/{run_id}/report_making")
    def making(run_id: str) -> JsonObject:
        """Return the state of the newest report: none, waiting, working, ready or failed.

        It has the progress, 0 to 1, or the reason, and the files that exist.
        """
        return reports.state(run_id).as_json(catalogue.resolve(run_id))

    @app.get("/api/runs/{run_id}/report/{name}")
    def file(run_id: str, name: str) -> FileResponse:
        """Return a document, plot or text of the report."""
        path = report_file(catalogue.resolve(run_id), name)
        kind = SHOWN.get(path.suffix)
        return FileResponse(
            path,
            filename=path.name,
            media_type=kind or "application/octet-stream",
            content_disposition_type="inline" if kind else "attachment",
            headers={"content-security-policy": DOCUMENT} if path.suffix == ".html" else None,
        )
