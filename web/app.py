"""FastAPI application of one vehicle; it has only routes, whose work other modules do."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import AbstractAsyncContextManager
from dataclasses import asdict, replace
from typing import Annotated, Any

from fastapi import FastAPI, HTTPException, Query, Request, WebSocket
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, HTMLResponse, JSONResponse, Response
from starlette.exceptions import HTTPException as StarletteHTTPException

from quadrotor.errors import (
    JobError,
    LinkError,
    MeasurementError,
    NoAnswerError,
    ParameterError,
    QuadlabError,
    RefusedError,
    StorageError,
    UnreachableError,
    UsageError,
)
from web import uplot
from web.access.invitation_link import link_and_code
from web.access.passwords import BusyError
from web.access.requester import Admin, Asker, Operator
from web.access.roles import Role, Session
from web.access.users import add_users
from web.commands import sticks
from web.commands.behaviors import described as described_behaviors
from web.commands.bodies import CameraBody, InvitationBody, ViewBody
from web.commands.control import add_control
from web.commands.drafts import add_drafts
from web.commands.plain_emergency import add_plain_emergency
from web.commands.routes import add_commands
from web.commands.trajectories import add_trajectories
from web.feature import Feature
from web.fleet.fleet import Fleet
from web.fleet.routes import add_fleet
from web.live import events
from web.live.pictures import add_pictures
from web.live.spectra import add_spectra
from web.live.telemetry import MOST_SIGNALS, described_expression
from web.parameters.routes import add_parameters
from web.setup.routes import add_setup
from web.signals import described
from web.signals.expression import answers
from web.static_files import FILES, STATIC, CachedFiles
from web.summary import Summary
from web.vehicle_context import VehicleContext
from web.view import proxy as pump

PAGES = {
    "/": "console/index.html",
    "/kill": "emergency/kill.html",
    "/fleet": "fleet/fleet.html",
    "/runs": "runs/runs.html",
    "/report/{run_id}": "experiments/report.html",
    "/setup": "setup/setup.html",
}
"""Documents of the page, by address."""
STATUS_OF: tuple[tuple[type[QuadlabError], int], ...] = (
    (RefusedError, 409),
    (ParameterError, 422),
    (MeasurementError, 422),
    (UnreachableError, 503),
    (NoAnswerError, 504),  # the page goes on checking what became of the command
    (LinkError, 503),
    (StorageError, 503),
    (BusyError, 503),
    (JobError, 503),
)


def create_app(
    context: VehicleContext,
    fleet: Fleet,
    features: Iterable[Feature],
    lifespan: Callable[[FastAPI], AbstractAsyncContextManager[None]] | None = None,
    files: CachedFiles = FILES,
) -> FastAPI:
    """Create one vehicle's application with the routes of these features."""
    app = FastAPI(
        title="quadlab",
        version="0.1.0",
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
    )
    _add_error_handlers(app)
    app.mount("/static", files)  # mounted first: most requests are for these
    _add_pages(app, files)
    _add_reading(app, context, fleet)
    add_commands(app, context.station, context.emergency, context.trajectories)
    add_trajectories(app, context.trajectories)
    add_drafts(app, context.drafts)
    _add_invitations(app, context)
    add_plain_emergency(app, context.vehicle, context.emergency, fleet.land_all)
    _add_view(app, context)
    _add_sockets(app, context)
    parameters = context.replica, context.gains, context.history, context.presets
    add_parameters(app, context.vehicle, *parameters)
    add_users(app, context.people)
    add_control(app, context.station)
    add_setup(app, context, fleet)
    add_spectra(app, context.log)
    add_fleet(app, fleet)
    add_pictures(app, context.forwarding)
    for feature in features:
        try:
            feature.add(app, context)
        except UsageError as error:
            context.hub.say("error", str(error))
    return app


def _add_page(app: FastAPI, files: CachedFiles, place: str, document: str) -> None:
    @app.get(place, include_in_schema=False)
    def page() -> HTMLResponse:
        return files.document(document)


def _add_pages(app: FastAPI, files: CachedFiles) -> None:
    for place, document in {**PAGES, **files.documents}.items():
        _add_page(app, files, place, document)

    @app.get("/design", include_in_schema=False)
    def design_page(_: Admin) -> HTMLResponse:
        return files.document("design/design.html")

    @app.get("/favicon.ico", include_in_schema=False)
    def icon() -> FileResponse:
        return FileResponse(STATIC / "core/icon.svg", media_type="image/svg+xml")


def _add_reading(app: FastAPI, context: VehicleContext, fleet: Fleet) -> None:

    @app.get("/vendor/{name}", include_in_schema=False)
    def vendor(name: str, request: Request) -> Response:
        return uplot.answer(name, request)

    @app.get("/api/session")
    def session(session: Asker) -> dict[str, Any]:
        """Return who this browser is signed in as, this page's vehicle, and all vehicles."""
        ours = {"vehicle": context.vehicle, "vehicles": fleet.names}
        return {**events.session_fields(session), **ours}

    @app.get("/api/signals")
    def signals() -> Response:
        """Return the signals for charts and table; topics in the order of the ages in a frame."""
        return Response(described(), media_type="application/json")

    @app.get("/api/expressions")
    def expressions(
        text: Annotated[list[str], Query(max_length=MOST_SIGNALS)],
    ) -> list[dict[str, Any]]:
        """Return the derived signal of each text, or what is wrong with it as `problem`."""
        return answers(text, described_expression)

    @app.get("/api/behaviors")
    def behaviors() -> list[dict[str, Any]]:
        """Return the behaviors of the Fly tab, with arguments as the vehicle describes them."""
        return described_behaviors()

    @app.get("/api/summary")
    async def summary() -> dict[str, Any]:
        """Return the newest status messages and the age of every topic, as in the page's bar."""
        return {**Summary(context).fresh(), "emergency": context.emergency.state}

    @app.get("/api/events")
    async def newest_events() -> list[dict[str, Any]]:
        """Return the newest log lines of the vehicle, the station and the page."""
        return context.hub.lines


def _add_invitations(app: FastAPI, context: VehicleContext) -> None:
    @app.post("/api/invitations")
    def invite(body: InvitationBody, session: Operator) -> dict[str, str | bool]:
        """Make a sign-in link for one more browser, with a picture of its QR code as a data URL.

        Operators may invite viewers; admins may invite operators too. `here_only` says that the
        link opens on this computer alone, because its page is served to no other.
        """
        role = Role(body.role)
        if role is not Role.VIEWER and not session.role.may(Role.ADMIN):
            raise HTTPException(403, f"{session.label} may invite viewers; ask an admin for more")
        return link_and_code(f"{context.base_url}/?token={context.people.tokens.mint(role)}")


def _add_view(app: FastAPI, context: VehicleContext) -> None:
    @app.get("/viser/", include_in_schema=False)
    def client() -> HTMLResponse:
        return HTMLResponse(
            pump.client_html(), headers={"content-security-policy": pump.CLIENT_POLICY}
        )

    @app.post("/api/view/camera")
    async def camera(body: CameraBody) -> dict[str, Any]:
        """Choose how one page's camera moves with the vehicle (a free one does not), and whether
        its view has shadows and a shaded ground.
        """
        if body.camera is not None:
            context.scene.cameras.choose(body.view, body.camera)
        if body.shadows is not None:
            context.scene.cameras.simplify(body.view, plain=not body.shadows)
        return {"camera": body.camera, "shadows": body.shadows}

    @app.put("/api/view")
    async def show(body: ViewBody, _: Operator) -> dict[str, Any]:
        """Change what the 3D view shows. It is shared by all pages, which are notified."""
        scene = context.scene
        scene.show(replace(scene.options, **body.model_dump(exclude_none=True)))
        context.hub.publish({"type": "view", "view": asdict(scene.options)})
        return asdict(scene.options)


def _add_sockets(app: FastAPI, context: VehicleContext) -> None:
    summary = Summary(context)

    @app.websocket("/viser")
    async def view(socket: WebSocket) -> None:
        session: Session = socket.scope["session"]
        await pump.pump(socket, context.view_server, session)

    @app.websocket("/ws/telemetry")
    async def telemetry(socket: WebSocket) -> None:
        await context.feed.serve(socket)

    @app.websocket("/ws/events")
    async def news(socket: WebSocket) -> None:
        def hello() -> dict[str, Any]:
            return {
                "vehicle": context.vehicle,
                "events": context.hub.lines,
                "revision": context.replica.revision,
                "emergency": context.emergency.state,
                "draft": context.drafts.summary(),
                "view": asdict(context.scene.options),
            }

        await events.serve(socket, context.hub, socket.scope["session"], hello, summary)

    @app.websocket("/ws/stick")
    async def stick(socket: WebSocket) -> None:
        session: Session = socket.scope["session"]
        await sticks.serve(socket, context.stick, session, context.control.may, context.hub.say)


def _add_error_handlers(app: FastAPI) -> None:
    """Answer every error of the API with JSON of one line: {"error": …}."""

    def line(status: int, text: str, headers: Any = None) -> Response:
        return JSONResponse({"error": " ".join(text.split())}, status, headers=headers)

    async def user_error(request: Request, error: Exception) -> Response:
        status = next((s for kind, s in STATUS_OF if isinstance(error, kind)), 400)
        if isinstance(error, StorageError) and "run_id" in request.path_params:
            status = 404
        return line(status, str(error))

    async def http_error(request: Request, error: Exception) -> Response:
        assert isinstance(error, StarletteHTTPException)
        detail = str(error.detail)
        if error.status_code == 404 and detail == "Not Found":
            detail = f"there is no {request.url.path} here; /api/openapi.json lists what there is"
        return line(error.status_code, detail, error.headers)

    async def body_error(_: Request, error: Exception) -> Response:
        assert isinstance(error, RequestValidationError)
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"][1:])
        came = f", not {first['input']!r:.80}" if place and first["type"] != "missing" else ""
        return line(422, f"{place or 'body'}: {first['msg']}{came}")

    app.add_exception_handler(QuadlabError, user_error)
    app.add_exception_handler(StarletteHTTPException, http_error)
    app.add_exception_handler(RequestValidationError, body_error)
