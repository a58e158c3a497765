"""Experiments of the station: list, start, finish, stop, questions and proposals.

The station flies and judges them; the page may be closed in the meantime. Reports are in
`web/experiments/reports.py`.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from fastapi import FastAPI
from pydantic import Field

from quadrotor.json_object import JsonObject
from vehicle_link.parameters.messages import from_descriptor, to_parameters
from web.access.requester import Operator
from web.commands.bodies import CommandBody
from web.feature import Feature
from web.latest import Live
from web.live.conversation import significant
from web.runs.judged import last_results

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext


class StartExperimentBody(CommandBody):
    name: str = Field(min_length=1, max_length=64)
    options: dict[str, bool | int | float | str] = Field({}, max_length=100)


class ConfirmBody(CommandBody):
    question: str = Field(min_length=1, max_length=500, description="a yes to no other one")


def new_feature() -> Feature:
    return Feature(add_experiments)


def add_experiments(app: FastAPI, context: VehicleContext) -> None:
    """Add the routes below /api/experiments."""
    station = context.station

    async def ask(body: CommandBody, requester: str, action: str, **more: Any) -> dict[str, bool]:
        if body.request_id:
            more["request_id"] = body.request_id
        await station.command("experiment", requester, action=action, **more)
        return {"accepted": True}

    @app.get("/api/experiments")
    async def experiments() -> JsonObject:
        """Return each experiment with its options, and the experiments' status.

        An option has bounds, choices, unit and description. `calibration`: the one that the
        experiment proposes; `problem`: why a user's own file cannot run.
        """
        answer = await station.command("experiment", "page", action="describe")
        return {"experiments": _described(answer), "status": experiment_summary(context.live)}

    @app.get("/api/experiments/results")
    def results() -> dict[str, JsonObject]:
        """Return the newest judged run of each experiment of this vehicle, with its verdict."""
        return last_results(context.catalogue, context.vehicle)

    @app.post("/api/experiments/start")
    async def start(body: StartExperimentBody, session: Operator) -> dict[str, bool]:
        """Arm and fly an experiment; the station checks the options."""
        options = to_parameters(body.options)
        return await ask(body, session.label, "start", name=body.name, options=options)

    @app.post("/api/experiments/finish")
    async def finish(body: CommandBody, session: Operator) -> dict[str, bool]:
        """End the manoeuvre now; the vehicle then lands and the run is judged."""
        return await ask(body, session.label, "finish")

    @app.post("/api/experiments/stop")
    async def stop(body: CommandBody, session: Operator) -> dict[str, bool]:
        """Stop the experiment's commands: the vehicle brakes and hovers."""
        return await ask(body, session.label, "stop")

    @app.post("/api/experiments/confirm")
    async def confirm(body: ConfirmBody, session: Operator) -> dict[str, bool]:
        """Answer yes to the question that the experiment waits with."""
        options = to_parameters({"question": body.question})
        return await ask(body, session.label, "confirm", options=options)

    @app.post("/api/experiments/accept")
    async def accept(body: CommandBody, session: Operator) -> dict[str, bool]:
        """Accept the proposed calibration: the vehicle applies all of it or nothing."""
        return await ask(body, session.label, "accept")

    @app.post("/api/experiments/reject")
    async def reject(body: CommandBody, session: Operator) -> dict[str, bool]:
        """Reject the proposal; nothing changes."""
        return await ask(body, session.label, "reject")


def _described(answer: Any) -> list[JsonObject]:
    options = [asdict(from_descriptor(one)) for one in answer.descriptors]
    about = zip_longest(
        answer.names, answer.descriptions, answer.calibrations, answer.problems, fillvalue=""
    )
    return [
        {
            "name": name,
            "description": text,
            "calibration": calibration,
            "problem": problem,
            "options": [
                {**option, "name": option["name"].removeprefix(f"{name}.")}
                for option in options
                if option["name"].startswith(f"{name}.")
            ],
        }
        for name, text, calibration, problem in about
    ]


def experiment_summary(live: Live) -> JsonObject | None:
    """Return the state of the station's experiment, for the page; None until it is reported."""
    status = live.newest("experiment_status")
    if status is None:
        return None
    names = (
        "name",
        "phase",
        "step",
        "requester",
        "manual",
        "reason",
        "run_id",
        "verdict",
        "instruction",
        "step_number",
        "step_count",
        "question",
        "decision",
    )
    limits = (float(x) for x in status.metric_limits)
    values = (float(x) for x in status.metric_values)
    return {
        **{name: getattr(status, name) for name in names},
        "elapsed": round(float(status.elapsed), 1),
        "planned": round(float(status.planned), 1),
        "step_share": round(float(status.step_share), 3),
        "live": [
            {"name": name, "value": significant(value), "unit": unit}
            for name, value, unit in zip(
                status.live_names, status.live_values, status.live_units, strict=True
            )
        ],
        "reports": list(status.reports),
        "metrics": [
            {
                "name": name,
                "value": significant(value),
                "limit": limit if math.isfinite(limit) else None,
            }
            for name, value, limit in zip(status.metric_names, values, limits, strict=True)
        ],
    }
