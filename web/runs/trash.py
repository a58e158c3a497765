"""Deletion of runs, its undoing, and the space on the disk.

Operators delete and restore; only an admin may remove runs for good before their time is over.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

from fastapi import FastAPI

from console.parameters.station import RecorderParameters
from console.runs.storage import storage
from console.runs.trash import delete_run, deleted_runs, purge, restore_run
from quadrotor.errors import QuadlabError
from quadrotor.json_object import JsonObject
from web.access.requester import Admin, Operator
from web.runs.bodies import RunsBody

if TYPE_CHECKING:
    from collections.abc import Callable

    from web.vehicle_context import VehicleContext

RECORDER = "station.recorder."


def add_trash(app: FastAPI, parts: VehicleContext) -> None:
    """Add the routes below /api/trash, and /api/storage."""
    catalogue = parts.catalogue

    @app.get("/api/storage")
    def disk() -> JsonObject:
        """Return sizes in bytes, and how long a recording can last.

        `lasts` is the time in s until only `keep_free` is left, at the rate of the newest runs or
        of the one being recorded; null if no rate is known.
        """
        found, limits = storage(catalogue), recorder_limits(parts)
        station = parts.live.current("station_status")
        rate, is_recording = found.rate, station is not None and bool(station.recording)
        if station is not None and is_recording and station.recording_duration > 1.0:
            rate = float(station.recording_bytes) / float(station.recording_duration)
        keep_free = round(limits["keep_free"] * 1e6)
        return {
            **asdict(found),
            "rate": rate,
            "recording": is_recording,
            "keep_free": keep_free,
            "warn_free": round(limits["warn_free"] * 1e6),
            "trash_days": limits["trash_keep"],
            "lasts": found.lasts(keep_free, rate),
        }

    @app.get("/api/trash")
    def deleted() -> list[JsonObject]:
        """Return the deleted runs, the newest deletion first."""
        return [asdict(run) for run in deleted_runs(catalogue)]

    @app.post("/api/trash")
    def delete(body: RunsBody, session: Operator) -> JsonObject:
        """Move runs to the trash; `refused` maps the id of each run that was not moved to the
        reason.
        """
        return _each(body.runs, lambda run_id: delete_run(catalogue, run_id, session.label))

    @app.post("/api/trash/restore")
    def restore(body: RunsBody, _: Operator) -> JsonObject:
        """Restore runs with notes, tags and marks."""
        return _each(body.runs, lambda run_id: restore_run(catalogue, run_id))

    @app.post("/api/trash/empty")
    def empty(session: Admin) -> JsonObject:
        """Delete all runs in the trash for good; `refused`: id → reason, of those not deleted."""
        purged = purge(catalogue)
        if purged.done:
            parts.hub.runs_changed(purged.done)
        return asdict(purged)

    def _each(run_ids: list[str], act: Callable[[str], None]) -> JsonObject:
        done: list[str] = []
        refused: dict[str, str] = {}
        for run_id in dict.fromkeys(run_ids):
            try:
                act(run_id)
                done.append(run_id)
            except QuadlabError as error:
                refused[run_id] = str(error)
        if done:
            parts.hub.runs_changed(done)
        return {"done": done, "refused": refused}


def recorder_limits(parts: VehicleContext) -> dict[str, float]:
    """Return the confirmed values of `station.recorder.*`, else their defaults."""
    defaults = RecorderParameters()
    return {
        name: float(parts.replica.value(f"{RECORDER}{name}") or getattr(defaults, name))
        for name in ("keep_free", "warn_free", "trash_keep")
    }
