"""Calibrations for the page: the vehicle's history of them, and an experiment's proposal.

They are flown, confirmed and decided like every experiment (`web/experiments/experiments.py`).
"""

from __future__ import annotations

import json
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from fastapi import FastAPI

from quadrotor.calibration_record import CalibrationRecord, parse_record
from quadrotor.errors import LinkError, MeasurementError, RefusedError
from quadrotor.json_object import JsonObject
from web.feature import Feature
from web.latest import Live

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext


def new_feature() -> Feature:
    return Feature(add_calibration)


def add_calibration(app: FastAPI, context: VehicleContext) -> None:
    """Add the route /api/calibrations."""
    station = context.station

    @app.get("/api/calibrations")
    async def calibrations() -> JsonObject:
        """Return all calibrations that the vehicle stores, newest first.

        The first of each name is in force. `history` is null, with the `problem`, while the vehicle
        does not answer.
        """
        try:
            answer = await station.command("calibrate", "page", action="history")
            history = [fields_of(parse_record(text)) for text in answer.records]
        except (LinkError, RefusedError, MeasurementError) as error:
            return {"history": None, "problem": " ".join(str(error).split())}
        return {"history": history, "problem": ""}


def proposal_summary(live: Live) -> JsonObject | None:
    """Return the calibration that the station's experiment proposes.

    It is None if there is none; it has a `problem` if it cannot be read.
    """
    status = live.newest("experiment_status")
    return None if status is None or not status.proposal else _proposal(str(status.proposal))


@lru_cache(maxsize=4)
def _proposal(text: str) -> JsonObject:
    try:
        return fields_of(parse_record(text))
    except MeasurementError as error:
        return {"problem": " ".join(str(error).split())}


def fields_of(record: CalibrationRecord) -> JsonObject:
    """Return the fields as in JSON, and whether each figure, and all, are within their limits."""
    fields: dict[str, Any] = json.loads(record.model_dump_json())
    for shown, figure in zip(fields["quality"], record.quality, strict=True):
        shown["good"] = figure.good
    return {**fields, "good": record.good}
