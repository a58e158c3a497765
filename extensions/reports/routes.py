"""The route /api/figure: a chart as a PDF for print."""

from __future__ import annotations

from fastapi import FastAPI, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response

from extensions.reports.figure import as_pdf
from quadrotor.errors import UsageError
from web.body import read_body
from web.feature import Feature
from web.vehicle_context import VehicleContext

LARGEST = 16_000_000
"""Largest SVG of a chart, in bytes."""


def add_figure(app: FastAPI, context: VehicleContext) -> None:
    del context  # all vehicles' figures are made alike

    @app.post("/api/figure")
    async def figure(request: Request) -> Response:
        """Return the PDF of a chart's SVG, as wide on paper, with its fonts embedded."""
        svg = await read_body(request, LARGEST)
        if len(svg) > LARGEST:
            raise UsageError(f"the chart is larger than {LARGEST // 10**6} MB; show less time")
        return Response(await run_in_threadpool(as_pdf, svg), media_type="application/pdf")


FEATURE = Feature(add_figure)
