"""Routes of the Settings page: /setup and those below /api/setup.

Parameters, beacons and users have their own routes, which the page uses as well.
"""

from __future__ import annotations

import asyncio
import time
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from fastapi import FastAPI

from quadrotor.errors import LinkError
from quadrotor.json_object import JsonObject
from vehicle_link.checks import Check, from_messages
from web.access.requester import Operator
from web.access.users import shown
from web.setup.page_checks import page_checks
from web.setup.vehicles import known_vehicles

if TYPE_CHECKING:
    from web.fleet.fleet import Fleet
    from web.vehicle_context import VehicleContext


def add_setup(app: FastAPI, context: VehicleContext, fleet: Fleet) -> None:
    station, people = context.station, context.people

    @app.get("/api/setup/vehicles")
    async def vehicles() -> list[dict[str, Any]]:
        """Return known vehicles; `last_seen` in s, epoch, null = never."""
        return await asyncio.to_thread(known_vehicles, fleet.lives, context.catalogue, time.time())

    @app.get("/api/setup/people")
    async def signed_in() -> list[JsonObject]:
        """Return the people with a signed-in browser; `last_seen` in s, epoch."""
        return [shown(one) for one in await asyncio.to_thread(people.sessions.people)]

    async def found(requester: str, *, again: bool) -> dict[str, Any]:
        ours = page_checks(
            context.base_url, context.tls, await asyncio.to_thread(people.accounts.count)
        )
        checked: float = 0.0
        others: list[Check] = []
        try:
            answer = await station.command("checks", requester, again=again)
            checked, others = float(answer.checked), from_messages(answer.checks)
        except LinkError as error:
            advice = f"{error}; start quadlab up or quadlab station"
            others = [Check("station", "fail", "does not answer", "answers", advice, "station")]
        return {"checked": checked or None, "checks": [asdict(one) for one in (*others, *ours)]}

    @app.get("/api/setup/checks")
    async def checks() -> dict[str, Any]:
        """Return the last results of station and vehicle, and the page's results now.

        `checked` is when the station and the vehicle were checked, in s, epoch; null = not yet.
        """
        return await found("page", again=False)

    @app.post("/api/setup/checks")
    async def check_again(session: Operator) -> JsonObject:
        """Run the checks again; 409 while the vehicle is armed."""
        return await found(session.label, again=True)
