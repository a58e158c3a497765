"""Positions of the beacons and their display: the routes below /api/beacons.

A layout is a parameter of the station (`station.bearings.layout`), so a change of it is handled
like that of every parameter: station and vehicle check it, and refuse it with a reason.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Annotated

import msgspec
from fastapi import FastAPI, Query, Request
from fastapi.responses import Response
from pydantic import Field

from bearing_sim.beacon_file import COLUMNS, read_beacons
from bearing_sim.beacons import PRESETS, Beacons, format_layout, parse_layout
from estimation.parameters import PRESETS as GAINS
from quadrotor.errors import LinkError, MeasurementError, OutOfBoundsError
from web.access.requester import Operator
from web.beacons.moves import BeaconMoves
from web.body import Body
from web.feature import Feature
from web.latest import Live
from web.parameters.replica import LAYOUT, PageParameters

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext

COMPARED = "station.comparison.estimators"
ALWAYS_SHOWN = ("none", "one frame", "vehicle")
"""Estimates that the view can always show."""

_ALLOWED = (
    'allowed is [[id, x, y, z], …] in m, {"preset": name}, or a CSV file with the header id,x,y,z'
)
_EXAMPLE = [[1, 1.0, 1.0, 0.1], [2, -1.0, 1.0, 0.1], [3, -1.0, -1.0, 0.1], [4, 1.0, -1.0, 0.1]]
_ROWS = {
    "type": "array",
    "minItems": 4,
    "maxItems": 32,
    "items": {"type": "array", "minItems": 4, "maxItems": 4, "items": {"type": "number"}},
}
_BODY = {
    "required": True,
    "content": {
        "application/json": {
            "schema": {
                "anyOf": [
                    _ROWS,
                    {
                        "type": "object",
                        "properties": {"preset": {"type": "string", "enum": list(PRESETS)}},
                        "required": ["preset"],
                        "additionalProperties": False,
                    },
                ]
            },
            "examples": {
                "rows": {"value": _EXAMPLE, "summary": "id, x, y, z in m of each"},
                "preset": {"value": {"preset": "paper"}},
            },
        },
        "text/csv": {"schema": {"type": "string"}, "example": "id,x,y,z\n1,1.0,1.0,0.1\n…"},
    },
}


class ViewBody(Body):
    """Change of the view; omitted fields keep their values."""

    rays: bool | None = Field(None, description="lines from the vehicle to the beacons")
    cones: bool | None = Field(None, description="cones of 3 sigma around them")
    map: bool | None = Field(None, description="map of the position bound")
    map_height: float | None = Field(None, ge=0.0, le=20.0, description="of the map's slice, m")
    estimate: str | None = Field(
        None,
        max_length=64,
        description="the ghost: none, one frame, vehicle, or an estimator of the comparison",
    )
    drag: bool | None = Field(None, description="handles that drag beacons")


class _Preset(msgspec.Struct, forbid_unknown_fields=True):
    preset: str


_Row = tuple[int, float, float, float]
_decode = msgspec.json.Decoder(list[_Row] | _Preset).decode


def new_feature() -> Feature:
    return Feature(add_beacons)


def add_beacons(app: FastAPI, context: VehicleContext) -> None:
    """Add the routes below /api/beacons; pass drags to the gain path."""
    shown = context.scene.beacons
    moves = BeaconMoves(context.gains, context.replica, context.hub, shown.put_back)
    shown.on_moved(moves.moved)

    def tell_view() -> None:
        context.hub.publish({"type": "beacon_view", **view()})

    def view() -> dict[str, object]:
        return {"view": asdict(shown.view), "legend": shown.legend()}

    shown.on_legend = tell_view

    @app.get("/api/beacons")
    async def beacons() -> dict[str, object]:
        """Return the confirmed layout, all presets, the shared view and the gains.

        The layout is null until it has been read. The view has its legend; `gains` are the presets
        of the complementary filter.
        """
        text = context.replica.value(LAYOUT)
        return {
            "layout": text,
            "beacons": rows_of(parse_layout(text)) if isinstance(text, str) else None,
            "presets": {name: rows_of(preset) for name, preset in PRESETS.items()},
            **view(),
            "gains": {
                name: {f"estimation.{key}": value for key, value in gains.items()}
                for name, gains in GAINS.items()
            },
        }

    @app.get("/api/beacons/file", response_class=Response)
    async def file() -> Response:
        """Return the confirmed layout as a CSV file, in the form that PUT accepts."""
        text = context.replica.value(LAYOUT)
        if not isinstance(text, str):
            raise LinkError("the layout of the beacons has not been read yet; is the station up?")
        headers = {"content-disposition": 'attachment; filename="beacons.csv"'}
        return Response(csv_of(parse_layout(text)), media_type="text/csv", headers=headers)

    @app.put("/api/beacons", openapi_extra={"requestBody": _BODY})
    async def change(
        request: Request,
        session: Operator,
        name: Annotated[
            str, Query(max_length=100, description="name of the CSV file in refusals")
        ] = "file",
    ) -> dict[str, object]:
        """Set a new layout, all or nothing.

        The answer is 422 if the body is not a layout (for a CSV file with line and column), and 409
        with the reason if station or vehicle refuse it.
        """
        kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
        text = layout_of(await request.body(), kind, name)
        applied, _ = await context.gains.change({LAYOUT: text}, session.label)
        confirmed = str(applied[LAYOUT])
        return {"layout": confirmed, "beacons": rows_of(parse_layout(confirmed))}

    @app.put("/api/beacons/view")
    async def show(body: ViewBody, _: Operator) -> dict[str, object]:
        """Change how the 3D view shows beacons and estimates.

        The view is shared by all pages, which are notified. `legend` is the scale of the bound map,
        in m, once it is drawn.
        """
        wanted = body.model_dump(exclude_none=True)
        if "estimate" in wanted:
            check_estimate(wanted["estimate"], context.replica, context.live)
        shown.show(replace(shown.view, **wanted))
        tell_view()
        return view()


def layout_of(body: bytes, kind: str, name: str) -> str:
    """Return the layout as one line of text, from a request's body; `kind` is its content type.

    Raises MeasurementError, DegenerateGeometryError or OutOfBoundsError.
    """
    if kind == "text/csv":
        return format_layout(read_beacons(body, name))
    try:
        wanted = _decode(body)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise MeasurementError(f"beacons: {error}; {_ALLOWED}") from None
    if isinstance(wanted, _Preset):
        if wanted.preset not in PRESETS:
            raise OutOfBoundsError(
                f"no preset is called {wanted.preset!r:.50}; there are {', '.join(PRESETS)}"
            )
        return wanted.preset
    return format_layout(Beacons([id for id, *_ in wanted], [place for _, *place in wanted]))


def rows_of(beacons: Beacons) -> list[list[float]]:
    """Return [[id, x, y, z], …], m."""
    places = beacons.positions_w.tolist()
    return [[id, *place] for id, place in zip(beacons.ids.tolist(), places, strict=True)]


def csv_of(beacons: Beacons) -> str:
    """Return the beacons as `bearing_sim.beacon_file` reads them, with all digits."""
    lines = [",".join(map(repr, row)) for row in rows_of(beacons)]
    return "\n".join([",".join(COLUMNS), *lines, ""])


def check_estimate(name: str, replica: PageParameters, live: Live) -> None:
    """Raise OutOfBoundsError for an estimate that is not computed."""
    message = live.newest("comparison")
    allowed = dict.fromkeys(ALWAYS_SHOWN)
    allowed |= dict.fromkeys(str(replica.value(COMPARED) or "").split())
    allowed |= dict.fromkeys(one.name for one in (message.estimators if message else ()))
    if name not in allowed:
        raise OutOfBoundsError(
            f"no estimate is called {name!r}; there are {', '.join(allowed)}: "
            "add an estimator to the comparison first"
        )
