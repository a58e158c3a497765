"""Runs for other programs: signed links for Foxglove and Lichtblick."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlencode, urlsplit

from fastapi import FastAPI, HTTPException, Request
from fastapi.responses import FileResponse

from flight_log.run_folder import log_of
from quadrotor.errors import StorageError
from quadrotor.json_object import JsonObject
from web.access.requester import Asker
from web.access.signed_links import AGE, SUFFIX

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext

VIEWERS = {
    "foxglove": "https://app.foxglove.dev/~/view",
    "lichtblick": "https://lichtblick-suite.github.io/lichtblick/",
}
"""Viewers that accept a deep link `?ds=remote-file&ds.url=…`."""


def log_response(run: Path) -> FileResponse:
    """Return a run as one MCAP file."""
    media_type = "application/octet-stream"
    return FileResponse(log_of(run), filename=f"{run.stem}{SUFFIX}", media_type=media_type)


def add_sharing(app: FastAPI, parts: VehicleContext) -> None:
    catalogue = parts.catalogue

    @app.post("/api/runs/{run_id}/link")
    def link(run_id: str, request: Request, _: Asker) -> JsonObject:
        """Return a link to the run's file that works for ten minutes without a session.

        `viewers` are addresses that open it in a viewer.
        """
        catalogue.resolve(run_id)
        here = f"{urlsplit(parts.base_url).scheme}://{request.headers['host']}"
        url = f"{here}{parts.links.make(run_id)}"
        query = urlencode({"ds": "remote-file", "ds.url": url})
        return {
            "url": url,
            "expires": time.time() + AGE,
            "viewers": {name: f"{place}?{query}" for name, place in VIEWERS.items()},
        }

    @app.head("/signed/runs/{name}", include_in_schema=False)
    @app.get("/signed/runs/{name}", include_in_schema=False)
    def signed(name: str) -> FileResponse:
        """Send the file. The gate accepts a request with a session or a valid signature."""
        try:
            path = catalogue.resolve(name.removesuffix(SUFFIX))
        except StorageError as error:
            raise HTTPException(404, str(error)) from error
        return log_response(path)
