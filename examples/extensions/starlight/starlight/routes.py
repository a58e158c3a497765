"""A route of the page's process: GET /api/starlight returns what the extension needs to know."""

from __future__ import annotations

from fastapi import FastAPI

from web.feature import Feature
from web.vehicle_context import VehicleContext


def add_routes(app: FastAPI, context: VehicleContext) -> None:
    """Add the routes of one vehicle; each path is below /api/starlight."""

    @app.get("/api/starlight")
    def vehicle() -> dict[str, str]:
        """Return the name of the vehicle."""
        return {"vehicle": context.vehicle}


FEATURE = Feature(add_routes)
