"""Calls of services by a client, with the same permissions and effects as on the page.

The requester is the signed-in person, whatever the request says; the station checks who has
control.
"""

from __future__ import annotations

import time
import uuid
from typing import TYPE_CHECKING, Any

from quadrotor.errors import RefusedError
from quadrotor.json_object import JsonObject
from vehicle_link.messages import decode, encode, new
from vehicle_link.topics.table import SERVICES
from web.access.roles import Role, Session

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext


async def call(context: VehicleContext, session: Session, service: str, payload: bytes) -> bytes:
    """Return the answer in CDR; a refusal is an answer with its reason. Raises LinkError."""
    request = decode(payload, f"{SERVICES[service]}_Request")
    fields = {
        name: getattr(request, name)
        for name in request.__dataclass_fields__
        if name not in ("requester", "__msgtype__")
    }
    fields["request_id"] = fields["request_id"] or uuid.uuid4().hex
    try:
        if reason := _refusal(session, service, fields):
            raise RefusedError(reason)
        answer = await _ask(context, session.label, service, fields)
    except RefusedError as error:
        answer = new(f"{SERVICES[service]}_Response", accepted=False, reason=str(error))
    return encode(answer)


def _refusal(session: Session, service: str, fields: JsonObject) -> str:
    """Return why this person may not call the service; "" if they may."""
    least = Role.OPERATOR
    if service == "emergency" and fields["action"] == "land":
        least = Role.VIEWER  # anyone may
    elif service == "control" and fields["action"] == "take":
        least = Role.ADMIN
    if session.role.may(least):
        return ""
    return f"{session.label} is {session.role}; this needs the role {least}"


async def _ask(
    context: VehicleContext, requester: str, service: str, fields: dict[str, Any]
) -> Any:
    if service == "emergency":
        action = str(fields["action"])
        if action not in ("land", "cut"):
            raise RefusedError(
                f"emergency: {action!r:.40} is not an action; allowed are land and cut"
            )
        await context.emergency.press(action, requester, fields["request_id"])
        return new(f"{SERVICES[service]}_Response", accepted=True)
    if service == "mark" and not fields["id"]:
        fields |= {"id": uuid.uuid4().hex, "pressed_ns": fields["pressed_ns"] or time.time_ns()}
    return await context.station.command(service, requester, **fields)
