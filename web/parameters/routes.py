"""Routes below /api/parameters: values, their history, presets and files.

Every change of a value uses the gain path, so that station and vehicle check it.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated, Literal

from fastapi import FastAPI, HTTPException, Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import PlainTextResponse
from pydantic import Field

from console.parameters.history import ParameterHistory
from console.parameters.presets import ParameterPresets, Preset
from quadrotor.json_object import JsonObject
from quadrotor.parameter_description import ParameterValue
from web.access.requester import Operator
from web.body import Body
from web.parameters.built_in_presets import built_in
from web.parameters.compare import compare, differing
from web.parameters.file import read_file, write_file
from web.parameters.replica import LAYOUT, PageParameters
from web.parameters.writer import ParameterWriter

ON_THE_GROUND = "ground"
PLACES = (LAYOUT, "beacons.layout", "behavior.keep_out")
NAME = r"^[^\x00-\x1f\x7f]+$"


class ChangeBody(Body):
    values: dict[str, bool | int | float | str] = Field(min_length=1, max_length=500)
    walks: bool = Field(False, description="in flight: go there in steps where one is too large")


class PresetBody(Body):
    name: str = Field(min_length=1, max_length=60, pattern=NAME)
    parameters: list[Annotated[str, Field(max_length=200)]] = Field(min_length=1, max_length=500)
    replaces: bool = False


def add_parameters(
    app: FastAPI,
    vehicle: str,
    replica: PageParameters,
    gains: ParameterWriter,
    history: ParameterHistory,
    presets: ParameterPresets,
) -> None:
    """Add all routes of a vehicle's parameters."""
    _add_values(app, replica, gains)
    _add_history(app, replica, history)
    _add_files(app, replica, vehicle)
    _add_presets(app, replica, presets)


def _add_values(app: FastAPI, replica: PageParameters, gains: ParameterWriter) -> None:
    @app.get("/api/parameters")
    async def parameters() -> JsonObject:
        """Return descriptions and confirmed values, as reported by the vehicle."""
        return replica.as_json()

    @app.put("/api/parameters")
    async def change(body: ChangeBody, session: Operator) -> JsonObject:
        """Change values, all or none, checked against their bounds; return the applied values."""
        applied, revision = await gains.change(body.values, session.label, walks=body.walks)
        return {
            "applied": applied,
            "revision": revision,
            "revisions": {name: replica.revision_of(name) for name in applied},
            "generation": replica.generation,
        }


def _add_history(app: FastAPI, replica: PageParameters, history: ParameterHistory) -> None:
    @app.get("/api/parameters/history")
    def changes(
        name: Annotated[str, Query(max_length=200)] = "",
        flight: Annotated[str | None, Query(max_length=120)] = None,
        limit: Annotated[int, Query(ge=1, le=1000)] = 200,
        before: Annotated[int, Query(ge=0)] = 0,
    ) -> JsonObject:
        """Return the changes, newest first.

        `flight`: a run id or `ground`; `before`: only changes older than this id.
        """
        wanted = "" if flight == ON_THE_GROUND else flight
        found = history.changes(name, wanted, limit, before)
        return {
            "changes": [
                {
                    "id": change.id,
                    "name": change.name,
                    "old": change.old,
                    "new": change.new,
                    "who": change.requester,
                    "stamp": change.stamp_ns * 1e-9,
                    "flight": change.flight,
                    "revision": change.revision,
                }
                for change in found
            ]
        }

    @app.get("/api/parameters/flight")
    async def flight() -> JsonObject:
        """Return the changes that undo those made since before the present or last flight."""
        last = await run_in_threadpool(history.flight)
        if last is None:
            nothing: JsonObject = {"run": None, "start": None, "is_over": True, "values": {}}
            return {**nothing, **compare(replica, {})}
        # Not the beacons: real ones have not moved.
        values = {name: value for name, value in last.values.items() if name not in PLACES}
        return {
            "run": last.run,
            "start": last.start_ns * 1e-9,
            "is_over": last.is_over,
            "values": last.values,
            **compare(replica, values),
        }


def _add_files(app: FastAPI, replica: PageParameters, vehicle: str) -> None:
    @app.get("/api/parameters/file")
    async def save(which: Literal["all", "modified"] = "all") -> PlainTextResponse:
        """Return a TOML file with unit, bounds, default and meaning of each value as comments."""
        now = datetime.now(UTC)
        what = "All parameters" if which == "all" else "Parameters that differ from their default"
        heading = f"{what} of {vehicle}, {now:%Y-%m-%d %H:%M:%S} UTC."
        replica.check({})
        text = write_file(
            replica.descriptions(), replica.values(), heading, modified_only=which == "modified"
        )
        name = f"{vehicle}_parameters_{now:%Y%m%dT%H%M%SZ}.toml"
        disposition = {"content-disposition": f'attachment; filename="{name}"'}
        return PlainTextResponse(text, headers=disposition, media_type="application/toml")

    @app.post(
        "/api/parameters/file",
        openapi_extra={"requestBody": {"required": True, "content": {"application/toml": {}}}},
    )
    async def read(request: Request, _: Operator) -> JsonObject:
        """Return the changes that loading this file would make; nothing is changed."""
        return compare(replica, await run_in_threadpool(read_file, await request.body()))


def _add_presets(app: FastAPI, replica: PageParameters, presets: ParameterPresets) -> None:
    @app.get("/api/parameters/presets")
    async def all_presets() -> JsonObject:
        """Return all presets, built-in ones first.

        `differs`: the number of values that differ from the present ones.
        """
        mine = await run_in_threadpool(presets.all)
        own = [
            {
                "id": name,
                "name": name,
                "built_in": True,
                "who": "",
                "stamp": None,
                "count": len(values),
                "differs": differing(replica, values),
            }
            for name, values in built_in(replica).items()
        ]
        return {"presets": own + [{**_facts(one), **_counts(one.values)} for one in mine]}

    @app.get("/api/parameters/presets/{preset}")
    async def look(preset: str) -> JsonObject:
        """Return the changes that switching to this preset would make."""
        found = built_in(replica)
        if preset in found:
            return compare(replica, found[preset])
        return compare(replica, (await run_in_threadpool(presets.get, _number(preset))).values)

    @app.post("/api/parameters/presets")
    async def save(body: PresetBody, session: Operator) -> JsonObject:
        """Save the confirmed values of these parameters under a name."""
        if body.name in built_in(replica):
            raise HTTPException(409, f"{body.name!r} is a built-in preset; choose another name")
        replica.check({})
        values = {n: v for n in body.parameters if (v := replica.value(n)) is not None}
        if missing := [n for n in body.parameters if n not in values]:
            raise HTTPException(422, f"unknown parameter {missing[0]!r}; the Gains tab lists all")
        saved = await run_in_threadpool(
            lambda: presets.save(body.name, values, session.label, replaces=body.replaces)
        )
        return _facts(saved)

    @app.delete("/api/parameters/presets/{preset}")
    def delete(preset: str, _: Operator) -> dict[str, bool]:
        """Delete a preset; it can be restored."""
        presets.delete(_number(preset))
        return {"deleted": True}

    @app.post("/api/parameters/presets/{preset}/restore")
    def restore(preset: str, _: Operator) -> JsonObject:
        """Restore a deleted preset."""
        return _facts(presets.restore(_number(preset)))

    def _counts(values: dict[str, ParameterValue]) -> dict[str, int]:
        return {"count": len(values), "differs": differing(replica, values)}


def _facts(preset: Preset) -> JsonObject:
    return {
        "id": str(preset.id),
        "name": preset.name,
        "built_in": False,
        "who": preset.requester,
        "stamp": preset.stamp_ns * 1e-9,
    }


def _number(preset: str) -> int:
    if not preset.isdecimal() or len(preset) > 12:
        raise HTTPException(404, f"there is no preset {preset[:60]!r}; the Gains tab lists all")
    return int(preset)
