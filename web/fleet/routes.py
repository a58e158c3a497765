"""Page of all vehicles, /fleet, and its routes, which are the same under every vehicle's address.

`/ws/fleet` sends the state of each vehicle at 2.5 Hz, also for the switch in the bar; with
`?plot=1` it also sends their positions, at 10 Hz.
"""

from __future__ import annotations

import asyncio
import contextlib

from fastapi import FastAPI, WebSocket

from web.access.requester import Asker
from web.commands.bodies import CommandBody
from web.fleet.fleet import Fleet
from web.live.conversation import converse, send_json

PERIOD = 0.4  # s between states
PLOT_PERIOD = 0.1  # s between positions


def add_fleet(app: FastAPI, fleet: Fleet) -> None:
    @app.get("/api/fleet")
    async def vehicles() -> list[dict[str, object]]:
        """Return the state of each vehicle; ages in s, null = never."""
        return fleet.summary()

    @app.post("/api/fleet/land")
    async def land(body: CommandBody, session: Asker) -> dict[str, object]:
        """Send an emergency landing to all vehicles whose motors are not known to be off.

        Any role may. The answer is sent once each vehicle has accepted or refused it.
        """
        return {"vehicles": await fleet.land_all(session.label, body.request_id)}

    @app.websocket("/ws/fleet")
    async def news(socket: WebSocket) -> None:
        plots = socket.query_params.get("plot") == "1"
        await socket.accept()
        await converse(socket, _talk(socket, fleet, plots=plots))


async def _talk(socket: WebSocket, fleet: Fleet, *, plots: bool) -> None:
    with contextlib.ExitStack() as looking:
        if plots:
            looking.enter_context(fleet.plotted())
        loop = asyncio.get_running_loop()
        due = 0.0
        while True:
            message: dict[str, object] = {"positions": fleet.positions()} if plots else {}
            if loop.time() >= due:
                due = loop.time() + PERIOD
                message["vehicles"] = fleet.summary()
            await send_json(socket, message)
            await asyncio.sleep(PLOT_PERIOD if plots else PERIOD)
