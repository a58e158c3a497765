"""The route /api/figure: a chart as a PDF for print."""

from __future__ import annotations

from fastapi import FastAPI, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response

from extensions.reports.figure import as_pdf
from web.feature import Feature
from web.vehicle_context import VehicleContext


def add_figure(app: FastAPI, context: VehicleContext) -> None:
    del context  # all vehicles' figures are made alike

    @app.post("/api/figure")
    async def figure(request: Request) -> Response:
        """Return the PDF of a chart's SVG, as wide on paper, with its fonts embedded."""
        made = await run_in_threadpool(as_pdf, await request.body())
        return Response(made, media_type="application/pdf")


FEATURE = Feature(add_figure)
