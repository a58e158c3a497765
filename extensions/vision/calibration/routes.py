"""Routes below /api/camera, and the websocket /camera: the guided calibration of a camera."""

from __future__ import annotations

import asyncio
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from fastapi import FastAPI, Query, Response, WebSocket
from pydantic import Field

from extensions.vision.calibration.calibrations import CameraCalibrations
from extensions.vision.calibration.guided import SIMULATED
from extensions.vision.tags.board_print import board_pdf
from extensions.vision.tags.charuco import Board
from extensions.vision.tracker.camera_store import CameraStore
from quadrotor.json_object import JsonObject
from vehicle_link.jobs import run
from web.access.requester import Operator
from web.body import Body
from web.feature import Feature
from web.live.conversation import converse
from web.vehicle_context import VehicleContext

PDF_TIME = 30.0  # s


class CameraBody(Body):
    """The camera, and the board in front of it; sizes in m."""

    camera: int | Literal["simulated"] = Field(description="as in /dev/video0, or simulated")
    columns: int = Board.columns
    rows: int = Board.rows
    square: float = Board.square
    marker: float = Board.marker


_shared: dict[Path, CameraCalibrations] = {}


def calibrations_of(data: Path) -> CameraCalibrations:
    """Return the calibrations of a data folder, which all vehicles and pages share."""
    return _shared.setdefault(data, CameraCalibrations(CameraStore(data)))


def _stop() -> None:
    while _shared:
        _, cameras = _shared.popitem()
        cameras.stop()


def add_camera_calibration(app: FastAPI, context: VehicleContext) -> None:
    cameras = calibrations_of(context.catalogue.folder.parent)

    @app.get("/api/camera/devices")
    def known() -> list[JsonObject]:
        """Return the cameras of this computer, the simulated one last, each with the intrinsics
        that were accepted for it, those in use first.
        """
        names: list[tuple[int | str, str]] = [*cameras.store.devices().items()]
        names.append((SIMULATED, "simulated camera"))
        return [
            {"camera": one, "name": name, "history": cameras.store.history(one)}
            for one, name in names
        ]

    @app.get("/api/camera/board.pdf")
    async def board(
        columns: Annotated[int, Query()] = Board.columns,
        rows: Annotated[int, Query()] = Board.rows,
        square: Annotated[float, Query()] = Board.square,
        marker: Annotated[float, Query()] = Board.marker,
    ) -> Response:
        """Return the board to be printed: a PDF page of the true size, with rulers."""
        drawing = partial(run, board_pdf, Board(columns, rows, square, marker), seconds=PDF_TIME)
        return Response(
            (await asyncio.to_thread(drawing)).encode("latin-1"), media_type="application/pdf"
        )

    @app.get("/api/camera")
    def state() -> JsonObject:
        """Return the newest calibration: none, running, ready or failed."""
        return cameras.as_json()

    @app.post("/api/camera")
    def begin(body: CameraBody, session: Operator) -> JsonObject:
        """Start the guided calibration of a camera; nothing changes until it is accepted."""
        board = Board(body.columns, body.rows, body.square, body.marker)
        cameras.begin(body.camera, board, session.label)
        return cameras.as_json()

    @app.post("/api/camera/finish")
    def finish(_: Operator) -> JsonObject:
        """End the calibration with the pictures taken so far."""
        cameras.finish()
        return cameras.as_json()

    @app.post("/api/camera/cancel")
    def cancel(_: Operator) -> JsonObject:
        """End the calibration without a result, or drop its result; nothing changes."""
        cameras.cancel()
        return cameras.as_json()

    @app.post("/api/camera/accept")
    def accept(session: Operator) -> JsonObject:
        """Store the result where `quadlab tracker` looks for the camera's intrinsics."""
        cameras.accept(session.label)
        return cameras.as_json()

    @app.websocket("/camera")
    async def follow(socket: WebSocket) -> None:
        await socket.accept()
        await converse(socket, cameras.talk(socket))


FEATURE = Feature(add_camera_calibration, _stop)
