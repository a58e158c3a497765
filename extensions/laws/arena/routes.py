"""Routes `/api/arena`: stored results of the arena, and the standing of each law in one."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from fastapi import FastAPI, HTTPException

from extensions.laws.arena.results import Cell, lines_of, read_cells, standings
from quadrotor.json_object import JsonObject
from web.feature import Feature

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext

FOLDER = "arena"
"""Folder of the data folder with results that the page shows."""


def add_arena(app: FastAPI, context: VehicleContext) -> None:
    place = context.catalogue.folder.parent / FOLDER

    @app.get("/api/arena")
    def results() -> JsonObject:
        """Return the results in the folder `arena` of the data folder, newest first."""
        return {"folder": str(place), "results": [path.stem for path in _stored(place)]}

    @app.get("/api/arena/{name}")
    def result(name: str) -> JsonObject:
        """Return the standing of each law, and all errors (m) with their intervals.

        Effort is in N/s, the time of a tick in s. A value that is null is not known, or that of
        flights of which half or more crashed.
        """
        path = next((one for one in _stored(place) if one.stem == name), None)
        if path is None:
            raise HTTPException(404, f"no result {name!r:.80} in {place}")
        cells = read_cells(path)
        return {
            "standings": [_finite(asdict(one)) for one in standings(cells)],
            "lines": [
                {
                    "course": line[0].course,
                    "disturbance": line[0].disturbance,
                    "laws": [_shown(one) for one in line],
                }
                for line in lines_of(cells)
            ],
        }


FEATURE = Feature(add_arena)


def _stored(place: Path) -> list[Path]:
    return sorted(place.glob("*.json"), key=lambda path: path.stat().st_mtime, reverse=True)


def _shown(cell: Cell) -> JsonObject:
    low, high = cell.interval()
    return _finite(
        {
            "law": cell.entry,
            "median": cell.median,
            "low": low,
            "high": high,
            "saturated": cell.saturated,
            "effort": cell.effort,
            "tick": cell.tick,
            "crashed": cell.failures,
            "flights": len(cell.rms),
        }
    )


def _finite(values: JsonObject) -> JsonObject:
    return {
        name: None if isinstance(one, float) and not math.isfinite(one) else one
        for name, one in values.items()
    }
