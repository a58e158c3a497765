"""Routes of commands, `POST /api/commands/…`, made from the table of commands."""

from __future__ import annotations

from inspect import cleandoc
from typing import Any

from fastapi import FastAPI

from vehicle_link.commands import COMMANDS, Command
from web.access.requester import Asker, Operator, operator_of
from web.commands.bodies import CommandBody, body_of
from web.commands.emergency import EmergencyCommands
from web.commands.trajectories import FOLLOW, TrajectoryMonitor
from web.live.station import Station


def add_commands(
    app: FastAPI, station: Station, emergency: EmergencyCommands, trajectories: TrajectoryMonitor
) -> None:
    """Add a route for each command that has one."""
    for command in COMMANDS.values():
        if command.has_route:
            _add_command(app, command, station, emergency, trajectories)


def _add_command(
    app: FastAPI,
    command: Command,
    station: Station,
    emergency: EmergencyCommands,
    trajectories: TrajectoryMonitor,
) -> None:
    async def send(body: CommandBody, session: Operator) -> dict[str, Any]:
        answer = await station.command(command.name, session.label, **body.fields)
        if command.name == "start_behavior" and body.fields["name"] == FOLLOW:
            trajectories.started(body.fields["arguments"])
        return {"accepted": True, **{name: getattr(answer, name) for name in command.answers}}

    async def press(body: Any, session: Asker) -> dict[str, Any]:
        if body.action == "cut":
            operator_of(session)
        pressed = await emergency.press(body.action, session.label, body.request_id)
        return {"accepted": True, "id": pressed}

    route = press if command.name == "emergency" else send
    route.__annotations__["body"] = body_of(command)
    description = cleandoc(command.request.__doc__ or "")
    app.post(f"/api/commands/{command.name}", name=command.name, description=description)(route)
