"""Experiments of the station: what there is, start, finish, stop; and the reports of runs.

The station flies and judges them; the page may close meanwhile.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fastapi import FastAPI
from fastapi.responses import FileResponse
from pydantic import BaseModel, ConfigDict, Field

from console.run_reports import read_result, report_file
from vehicle_link.parameter_messages import from_descriptor, to_parameters
from web.asking import Operator
from web.live import Live

if TYPE_CHECKING:
    from web.parts import Parts

STATIC = Path(__file__).parent / "static"
SHOWN = {
    ".png": "image/png",
    ".md": "text/plain; charset=utf-8",
    ".csv": "text/plain; charset=utf-8",
    ".json": "application/json",
    ".pdf": "application/pdf",
}
"""What a browser may show; anything else of a report is downloaded."""


class ExperimentBody(BaseModel):
    """finish, stop."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    request_id: str | None = Field(
        None, min_length=1, max_length=64, description="the same id again is the same request"
    )

    @property
    def fields(self) -> dict[str, str]:
        return {"request_id": self.request_id} if self.request_id else {}


class StartExperimentBody(ExperimentBody):
    name: str = Field(min_length=1, max_length=64)
    options: dict[str, bool | int | float | str] = Field({}, max_length=100)


def add_experiments(app: FastAPI, parts: Parts) -> None:
    """The routes below /api/experiments and /api/runs/{run_id}/report."""
    station, catalogue = parts.station, parts.catalogue

    async def ask(
        body: ExperimentBody, requester: str, action: str, **more: Any
    ) -> dict[str, bool]:
        await station.command("experiment", requester, action=action, **more, **body.fields)
        return {"accepted": True}

    @app.get("/api/experiments")
    async def experiments() -> dict[str, Any]:
        """Each with its options: bounds, choices, unit, description; and how it stands."""
        answer = await station.answer("experiment", "page", action="describe")
        options = [asdict(from_descriptor(one)) for one in answer.descriptors]
        return {
            "experiments": [
                {
                    "name": name,
                    "description": text,
                    "options": [
                        {**option, "name": option["name"].split(".", 1)[1]}
                        for option in options
                        if option["name"].split(".", 1)[0] == name
                    ],
                }
                for name, text in zip(answer.names, answer.descriptions, strict=True)
            ],
            "status": experiment_summary(parts.live),
        }

    @app.post("/api/experiments/start")
    async def start(body: StartExperimentBody, session: Operator) -> dict[str, bool]:
        """Arms and flies; the station checks the options."""
        options = to_parameters(body.options)
        return await ask(body, session.label, "start", name=body.name, options=options)

    @app.post("/api/experiments/finish")
    async def finish(body: ExperimentBody, session: Operator) -> dict[str, bool]:
        """Ends the manoeuvre now: handed back, landed, judged."""
        return await ask(body, session.label, "finish")

    @app.post("/api/experiments/stop")
    async def stop(body: ExperimentBody, session: Operator) -> dict[str, bool]:
        """Commands no more: the vehicle brakes and hovers."""
        return await ask(body, session.label, "stop")

    @app.get("/api/runs/{run_id}/report")
    def report(run_id: str) -> dict[str, Any]:
        """Verdict, figures, options and files of the experiment judged on this run."""
        return read_result(catalogue.resolve(run_id))

    @app.get("/api/runs/{run_id}/report/{name}")
    def file(run_id: str, name: str) -> FileResponse:
        """A plot or text of the report."""
        path = report_file(catalogue.resolve(run_id), name)
        kind = SHOWN.get(path.suffix)
        return FileResponse(
            path,
            filename=path.name,
            media_type=kind or "application/octet-stream",
            content_disposition_type="inline" if kind else "attachment",
        )

    @app.get("/report/{run_id}", include_in_schema=False)
    def report_page(run_id: str) -> FileResponse:
        return FileResponse(STATIC / "report.html")


def experiment_summary(live: Live) -> dict[str, Any] | None:
    """How the station's experiment stands, for the page; None before the station told."""
    status = live.newest("experiment_status")
    if status is None:
        return None
    names = (
        "name", "phase", "step", "requester", "manual", "reason", "run_id", "verdict",
    )  # fmt: skip
    limits = (float(x) for x in status.metric_limits)
    values = (float(x) for x in status.metric_values)
    return {
        **{name: getattr(status, name) for name in names},
        "elapsed": round(float(status.elapsed), 1),
        "planned": round(float(status.planned), 1),
        "reports": list(status.reports),
        "metrics": [
            {
                "name": name,
                "value": float(f"{value:.6g}") if math.isfinite(value) else None,
                "limit": limit if math.isfinite(limit) else None,
            }
            for name, value, limit in zip(status.metric_names, values, limits, strict=True)
        ],
    }
