"""Emergencies without scripts: the forms of the pages, answered with a small page.

A page's buttons are forms until its scripts have started, and remain so where none run. A landing
is sent at once. A cut has to be confirmed, because a form cannot be held; not on `/kill`, because
opening that page is the decision. The answer shows the state of the newest press, and reloads
itself until the vehicle has acknowledged it.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from html import escape
from typing import Any

from fastapi import FastAPI, Request
from fastapi.responses import RedirectResponse, Response

from quadrotor.errors import QuadlabError
from web.access.pages import page_response, small_page
from web.access.requester import Asker
from web.access.roles import Role, Session
from web.access.sign_in import read_form
from web.commands.emergency import EmergencyCommands, Message

SOON = 0.3
"""Longest time, in s, that the request waits for the vehicle's answer before it is answered."""
AGAIN = 1
"""Time, in s, after which the page reloads while a press is not yet acknowledged."""
NAMES = {"land": "Emergency land", "cut": "Cut motors"}
DONE = {"land": "Landing", "cut": "Motors cut"}

_LAND = '<button name="action" value="land" class="caution">Emergency land</button>'
_CUT = '<button name="action" value="cut" class="cut">Cut motors</button>'
_SURE = '<input type="hidden" name="sure" value="yes">'
_BACK = '<p><a href="./">Back to the page</a></p>'
_STYLE = """<style>form{margin:1rem 0}button{font-weight:600;padding:.7rem 1.1rem}
.caution{color:var(--amber);border-color:var(--amber-line)}
.cut{background:var(--red);border-color:var(--red);color:var(--on-red)}
.cut:hover{border-color:var(--text)}a{color:inherit}</style>"""


def add_plain_emergency(
    app: FastAPI,
    vehicle: str,
    emergency: EmergencyCommands,
    land_all: Callable[[str], Awaitable[list[Message]]],
) -> None:
    """Add the page /emergency of a vehicle; `land_all` lands all vehicles for a requester."""

    @app.get("/emergency", include_in_schema=False)
    async def state(session: Asker) -> Response:
        return _page(*_state_line(vehicle, emergency.state), _buttons(session))

    @app.post("/emergency", include_in_schema=False)
    async def press(session: Asker, request: Request) -> Response:
        try:
            form = await read_form(request)
        except ValueError as error:
            return _page(f"Nothing was done: {error}.", "", _buttons(session), status=400)
        action = form.get("action", "")
        if action == "all":
            return _page(_fleet_line(await land_all(session.label)), "", "")
        if action not in NAMES:
            said = f"Nothing was done: {action!r:.40} is neither land nor cut."
            return _page(said, "", _buttons(session), status=422)
        if action == "cut" and not session.role.may(Role.OPERATOR):
            said = f"{session.label} may land {vehicle}, but not cut its motors."
            return _page(said, "", _buttons(session), status=403)
        if action == "cut" and form.get("sure") != "yes":
            return _page(f"Cut the motors of {vehicle}? It falls.", "", _LAND + _SURE + _CUT)
        try:
            with contextlib.suppress(TimeoutError):  # the press continues and is shown
                await asyncio.wait_for(emergency.press(action, session.label), SOON)
        except QuadlabError as error:
            said = f"{vehicle}: {NAMES[action]} failed: {error}. Press again."
            return _page(said, "", _buttons(session), status=409)
        return RedirectResponse("emergency", 303)


def _buttons(session: Session) -> str:
    return _LAND + (_CUT if session.role.may(Role.OPERATOR) else "")


def _state_line(vehicle: str, press: Message | None) -> tuple[str, str]:
    """Return a line on the newest press, and the tag that reloads the page while it is pending."""
    if press is None:
        return f"{vehicle}: no emergency was pressed.", ""
    name, phase = f"{NAMES[press['action']]} by {press['by']}", press["phase"]
    again = f'<meta http-equiv="refresh" content="{AGAIN}">'
    if phase == "sent":
        tries = f", try {press['try']} of {press['tries']}" if press["try"] > 1 else ""
        return f"{vehicle}: {name}: sent {press['age']:.1f} s ago, not acknowledged{tries}.", again
    if phase == "accepted":
        return f"{vehicle}: {name}: accepted, not yet shown by the vehicle.", again
    if phase == "failed":
        return f"{vehicle}: {name} failed: {press['reason']}. Press again.", ""
    note = f"; {press['reason']}" if press["reason"] else ""
    done = f"{DONE[press['action']]}, pressed by {press['by']}"
    return f"{vehicle}: {done}, acknowledged after {press['after']:.2f} s{note}.", ""


def _fleet_line(vehicles: list[dict[str, Any]]) -> str:
    outcomes = (
        f"{one['name']}: {one['outcome']}" + (f", {one['reason']}" if one.get("reason") else "")
        for one in vehicles
    )
    return f"Emergency land of all: {'; '.join(outcomes)}."


def _page(said: str, again: str, buttons: str, status: int = 200) -> Response:
    form = f'<form method="post" action="emergency">{buttons}</form>' if buttons else ""
    body = f"{_STYLE}{again}<h1>{escape(said)}</h1>{form}{_BACK}"
    return page_response(small_page("quadlab: emergency", body), status)
