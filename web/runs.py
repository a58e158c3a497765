"""Recorded runs: the catalogue's list, notes, and the log files themselves.

A run is found by its id in the catalogue and never by a path from outside.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from fastapi.responses import FileResponse

from console.catalogue import Catalogue
from console.run_reports import has_report
from web.asking import Operator
from web.commands import NotesBody


def add_runs(app: FastAPI, catalogue: Catalogue) -> None:
    """The routes below /api/runs. An unknown run is a StorageError, answered with 404."""

    @app.get("/api/runs")
    def runs(search: str = "", limit: int = 200, offset: int = 0) -> list[dict[str, Any]]:
        """Newest first; `search` looks in id, operator and notes. `report`: whether it has one."""
        entries = catalogue.runs(search, limit=min(max(limit, 1), 1000), offset=max(offset, 0))
        return [
            {**asdict(entry), "report": has_report(catalogue.folder / Path(entry.file).name)}
            for entry in entries
        ]

    @app.head("/api/runs/{run_id}/download", include_in_schema=False)
    @app.get("/api/runs/{run_id}/download")
    def download(run_id: str) -> FileResponse:
        """The run's MCAP file; ranges work, so a broken download can be resumed."""
        path = catalogue.resolve(run_id)
        return FileResponse(path, filename=path.name, media_type="application/octet-stream")

    @app.put("/api/runs/{run_id}/notes")
    def set_notes(run_id: str, body: NotesBody, _: Operator) -> dict[str, str]:
        catalogue.set_notes(run_id, body.notes)
        return {"notes": body.notes}
