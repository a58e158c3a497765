"""Vehicle's own logs: list, download, and back-fill of a run from them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from fastapi import FastAPI
from fastapi import Path as InPath

from console.catalogue.catalogue import SUFFIX
from quadrotor.json_object import JsonObject
from web.access.requester import Operator
from web.latest import Live

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext

ONBOARD = "onboard"
Name = Annotated[str, InPath(max_length=160)]
FIELDS = ("kind", "name", "phase", "bytes", "total_bytes", "rate", "problem")


def add_onboard(app: FastAPI, parts: VehicleContext) -> None:
    """Add the routes below /api/onboard, and /api/runs/{run_id}/backfill."""
    folder = parts.catalogue.folder.parent / ONBOARD

    @app.get("/api/onboard")
    async def logs() -> JsonObject:
        """Return the vehicle's logs, newest first.

        Times are s of its clock, null where not known; `here` is the id under which /replay shows
        the copy on this computer.
        """
        answer = await parts.station.command("onboard_files", "")
        return {
            "vehicle": parts.vehicle,
            "free_bytes": int(answer.free_bytes),
            "logs": [
                {
                    "name": str(one.name),
                    "bytes": int(one.size),
                    "start": one.start_ns * 1e-9 if one.start_ns else None,
                    "end": one.end_ns * 1e-9 if one.end_ns else None,
                    "closed": bool(one.closed),
                    "recovered": bool(one.recovered),
                    "here": copy_of(folder, parts.vehicle, str(one.name), int(one.size)),
                }
                for one in answer.files
            ],
        }

    @app.post("/api/onboard/{name}/download")
    async def download(name: Name, session: Operator) -> dict[str, bool]:
        """Start or continue a download of the log; progress is published as `transfers`."""
        return await _transfer("download", name, session.label)

    @app.post("/api/onboard/{name}/cancel")
    async def cancel(name: Name, session: Operator) -> dict[str, bool]:
        """Cancel a transfer, and discard the received bytes."""
        return await _transfer("cancel", name, session.label)

    @app.post("/api/runs/{run_id}/backfill")
    async def backfill(run_id: str, session: Operator) -> dict[str, bool]:
        """Compare the run with the vehicle's log again, and fetch what is missing."""
        parts.catalogue.get(run_id)
        return await _transfer("backfill", run_id, session.label)

    @app.post("/api/runs/{run_id}/backfill/cancel")
    async def cancel_backfill(run_id: str, session: Operator) -> dict[str, bool]:
        return await _transfer("cancel", run_id, session.label)

    async def _transfer(action: str, name: str, requester: str) -> dict[str, bool]:
        await parts.station.command("transfer", requester, action=action, name=name)
        return {"accepted": True}


def copy_of(folder: Path, vehicle: str, name: str, size: int) -> str | None:
    """Return the id of a log of that name and size on this computer, or None.

    It was fetched, or is of a vehicle simulated here.
    """
    for path, prefix in (
        (folder / vehicle / name, f"{ONBOARD}:{vehicle}:"),
        (folder / name, f"{ONBOARD}:"),
    ):
        is_plain = path.name == name and path.suffix == SUFFIX
        if is_plain and path.is_file() and path.stat().st_size == size:
            return f"{prefix}{path.stem}"
    return None


def transfers_summary(live: Live) -> list[JsonObject]:
    """Return the transfers from the vehicle, as in quadlab_msgs/Transfer; sizes in bytes."""
    message = live.current("transfers")
    if message is None:
        return []
    return [{name: getattr(one, name) for name in FIELDS} for one in message.transfers]
