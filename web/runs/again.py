"""Settings with which a run is flown again: its experiment with the options, gains and beacons."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fastapi import FastAPI
from fastapi.concurrency import run_in_threadpool

from console.runs.report_folders import has_report, read_result
from flight_log.attached import PARAMETERS, parameters_of
from flight_log.reader import read_attachments
from flight_log.run_folder import log_of
from quadrotor.errors import StorageError
from quadrotor.json_object import JsonObject
from quadrotor.parameter_description import ParameterValue
from web.parameters.compare import compare

if TYPE_CHECKING:
    from console.catalogue.catalogue import Catalogue
    from web.vehicle_context import VehicleContext

SETTINGS = ("control.", "estimation.", "behavior.", "station.bearings.")
"""Beginnings of the parameters that are set again. What belongs to the vehicle, to its safety and
to the simulated world stays as it is."""


def add_again(app: FastAPI, parts: VehicleContext) -> None:
    """Add the route `/api/runs/{run_id}/again`."""

    @app.get("/api/runs/{run_id}/again")
    async def again(run_id: str) -> JsonObject:
        """Return the settings of a run at its start: `experiment` ("" for none) and `options`, and
        how its parameters differ from the present ones, as a preset's comparison does.
        """
        values, experiment = await run_in_threadpool(_settings, parts.catalogue, run_id)
        return {"run": run_id, **experiment, **compare(parts.replica, values)}


def _settings(catalogue: Catalogue, run_id: str) -> tuple[dict[str, ParameterValue], JsonObject]:
    """Return parameters, and experiment with options. Raises StorageError or LogFormatError."""
    run = catalogue.resolve(run_id)
    at_start = parameters_of(read_attachments(log_of(run)).get(PARAMETERS))
    values = {name: value for name, value in at_start.items() if name.startswith(SETTINGS)}
    if not values:
        raise StorageError(
            f"run {run_id} cannot be flown again: its log has no parameters of the controller; "
            "runs that this station recorded have them"
        )
    result = read_result(run) if has_report(run) else {}
    options = result.get("options")
    return values, {
        "experiment": str(result.get("experiment", "")),
        "options": options if isinstance(options, dict) else {},
    }
