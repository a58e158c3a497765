"""The websocket `/comparison`: estimators of the comparison and residuals, for an open Beacons tab.

It sends JSON at 5 Hz, because people read numbers no faster, and nothing while there is no
comparison. Charts get the same figures at their own rate as signals (web.signals). A page opens
this socket while its tab is open.
"""

from __future__ import annotations

import asyncio
import math
from typing import Any, Final

from fastapi import FastAPI, WebSocket

from vehicle_link.messages.records import EstimatorComparison, EstimatorResult
from web.feature import Feature
from web.latest import Live
from web.live.conversation import converse, send_json, significant
from web.vehicle_context import VehicleContext

RATE = 5.0  # Hz
TOPIC: Final = "comparison"


def add_comparison(app: FastAPI, context: VehicleContext) -> None:
    @app.websocket("/comparison")
    async def comparison(socket: WebSocket) -> None:
        await serve(socket, context.live)


FEATURE = Feature(add_comparison)


async def serve(socket: WebSocket, live: Live) -> None:
    """Serve one page's socket until it closes."""
    await socket.accept()

    async def talk() -> None:
        sent: EstimatorComparison | None = None
        while True:
            message = live.current(TOPIC)
            if message is not None and message is not sent:
                sent = message
                await send_json(socket, as_json(message))
            await asyncio.sleep(1.0 / RATE)

    await converse(socket, talk())


def as_json(message: EstimatorComparison) -> dict[str, Any]:
    """Return the message for the page: lengths in mm, angles in degrees; null = not known."""
    return {
        "truth": message.truth,
        "duration": significant(message.duration),
        "sigma": _degrees(message.sigma),
        "estimators": [_estimator(one) for one in message.estimators],
    }


def _estimator(one: EstimatorResult) -> dict[str, object]:
    """Return an estimator's figures in a fixed order, because names would be most of the bytes.

    They are the position error now, its rms and maximum over the last 10 s, the rms of the attitude
    error, rms and maximum of the position error over the session, and the share of a core in
    percent.
    """
    lengths = (one.position_error, one.position_rms_recent, one.position_max_recent)
    return {
        "name": one.name,
        "state": "" if one.converged else "settling" if one.initialized else "not started",
        "figures": [
            *(significant(1e3 * length, 4) for length in lengths),
            _degrees(one.attitude_rms_recent),
            significant(1e3 * one.position_rms, 4),
            significant(1e3 * one.position_max, 4),
            significant(1e2 * one.processor, 2),
        ],
        "residuals": [
            [int(id), _degrees(angle)]
            for id, angle in zip(one.beacon_ids, one.residuals, strict=False)
        ],
    }


def _degrees(radians: float) -> float | None:
    return significant(math.degrees(radians), 3)
