"""The services that the vehicle offers on the link: commands, parameters, time.

Commands are idempotent by request id. A refusal by the flight process is an answer with its reason;
a flight process that does not answer is an error, as the outcome is unknown.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeVar

from msgspec.structs import fields as fields_of

from quadrotor.errors import RefusedError
from vehicle import mailbox
from vehicle.comms.calibrations import Calibrations
from vehicle.comms.commands import FlightMailbox, FlightParameters
from vehicle.comms.vehicle_clock import VehicleClock
from vehicle_link.commands import COMMANDS, Command
from vehicle_link.messages import Message, new
from vehicle_link.messages.records import ChangeParametersRequest, CommandRequest
from vehicle_link.parameters.messages import from_parameters, to_parameters
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.idempotent import Idempotent, prepare
from vehicle_link.transport.node import Node
from vehicle_link.transport.parameter_service import serve_parameters
from vehicle_link.transport.time_sync import serve_time_sync

Q = TypeVar("Q", bound=Message)
CALIBRATIONS = 3
"""Calibration requests answered at once: the history must not wait for a running calibration."""


def serve(
    node: Node,
    flight: FlightMailbox,
    parameters: FlightParameters,
    calibrations: Calibrations,
    clock: VehicleClock,
    say: Callable[[int, str], None],
) -> None:
    """Declare all services on the node; they answer on threads of their own.

    Args:
        say: reports a command that arrived too late, as (level, text).
    """

    def ask(command: Command, request: CommandRequest) -> Message:
        check_in_time(command.name, request, clock.now_ns(), say)
        return _ask_flight(flight, command, request)

    for name, command in COMMANDS.items():
        if command.at == "vehicle":
            if name == "change_parameters":
                change = partial(_change_parameters, parameters)
                serve_command(node, name, change, command.at_once)
            else:
                serve_command(node, name, partial(ask, command), command.at_once)
    serve_command(node, "calibrate", calibrations.answer, CALIBRATIONS)
    serve_time_sync(node, clock.now_ns)
    serve_parameters(node, parameters)


def serve_command(node: Node, service: str, handler: Callable[[Q], Message], at_once: int) -> None:
    """Serve a command, executing it once per request id."""
    prepare(SERVICES[service])
    node.serve(service, SERVICES[service], Idempotent(handler), at_once=at_once)


def check_in_time(
    name: str, request: CommandRequest, now_ns: int, say: Callable[[int, str], None]
) -> None:
    """Refuse a command that spent so long on the link that its sender no longer waits for it.

    Raises RefusedError.
    """
    valid_until_ns = int(getattr(request, "valid_until_ns", 0))
    if valid_until_ns and now_ns > valid_until_ns:
        late = f"{(now_ns - valid_until_ns) * 1e-9:.1f} s too late over the link"
        say(mailbox.WARN, f"{name} by {request.requester} arrived {late}: it was not carried out")
        raise RefusedError(f"it arrived {late}; send the command again")


def _ask_flight(flight: FlightMailbox, command: Command, request: CommandRequest) -> Message:
    fields = {field.name: getattr(request, field.name) for field in fields_of(command.request)}
    if (arguments := fields.get("arguments")) is not None:
        fields["arguments"] = from_parameters(arguments)
    reply = flight.ask(lambda i: command.request(**{**fields, "request_id": i}))
    more = {"kind": reply.kind} if reply.kind else {}
    return new(f"{command.service}_Response", accepted=reply.accepted, reason=reply.reason, **more)


def _change_parameters(parameters: FlightParameters, request: ChangeParametersRequest) -> Message:
    values = from_parameters(request.parameters)
    applied, revision = parameters.change(values, request.requester)
    return new(
        f"{SERVICES['change_parameters']}_Response",
        accepted=True,
        applied=to_parameters(applied),
        revision=revision,
    )
