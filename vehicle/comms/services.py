"""The services the vehicle offers on the link: commands, parameters, time.

Commands are idempotent by request id; what the flight process refuses is an answer with its
reason, and a flight process that does not answer an error: no one knows what became of it.
"""

from __future__ import annotations

from collections.abc import Callable

from quadrotor.errors import NoAnswerError, QuadlabError
from vehicle.comms.calibrations import Calibrations
from vehicle.comms.commands import FlightMailbox, FlightParameters
from vehicle.comms.vehicle_clock import VehicleClock
from vehicle.processes import mailbox
from vehicle_link.messages import Message, decode, encode, new
from vehicle_link.parameters.messages import from_parameters, to_parameters
from vehicle_link.parameters.service import serve_parameters
from vehicle_link.time_sync import serve_time_sync
from vehicle_link.topics import SERVICES
from vehicle_link.transport.idempotent import Idempotent
from vehicle_link.transport.node import Node

EMERGENCIES = 4
"""At once: a cut must not wait behind a landing that the flight process does not answer."""
CALIBRATIONS = 3
"""At once: the history must not wait for a gyroscope that is being calibrated."""


def serve(
    node: Node,
    flight: FlightMailbox,
    parameters: FlightParameters,
    calibrations: Calibrations,
    clock: VehicleClock,
) -> None:
    """Declare all services on the node; they answer on threads of their own."""
    commands = _Commands(flight, parameters)
    for service in ("emergency", "disarm", "arm", "start_behavior", "change_parameters", "bench"):
        at_once = EMERGENCIES if service == "emergency" else 1
        serve_command(node, service, getattr(commands, service), at_once)
    serve_command(node, "calibrate", calibrations.answer, CALIBRATIONS)
    serve_time_sync(node, clock.now_ns)
    serve_parameters(node, parameters)


def serve_command(
    node: Node, service: str, handler: Callable[[Message], Message], at_once: int
) -> None:
    """Serve a command, once a request id; what the handler refuses is an answer."""
    srv_type = SERVICES[service]
    _prepare(srv_type)
    node.serve(service, srv_type, Idempotent(_refusing(srv_type, handler)), at_once=at_once)


def _prepare(srv_type: str) -> None:
    """Make the serialisers now: rosbags writes them on first use, which takes up to 0.1 s."""
    encode(new(f"{srv_type}_Response"))
    decode(encode(new(f"{srv_type}_Request")), f"{srv_type}_Request")


def _refusing(srv_type: str, handler: Callable[[Message], Message]) -> Callable[[Message], Message]:
    """Make a handler whose refusals are answers: not accepted, with the error as the reason."""

    def handle(request: Message) -> Message:
        try:
            return handler(request)
        except NoAnswerError:
            raise  # it is not known what became of it
        except QuadlabError as error:
            return new(f"{srv_type}_Response", accepted=False, reason=str(error))

    return handle


class _Commands:
    """One method a service: request message in, response message out."""

    def __init__(self, flight: FlightMailbox, parameters: FlightParameters) -> None:
        self._flight = flight
        self._parameters = parameters

    def arm(self, request: Message) -> Message:
        reply = self._flight.ask(lambda i: mailbox.Arm(i, request.requester))
        return _response("arm", reply)

    def disarm(self, request: Message) -> Message:
        reply = self._flight.ask(lambda i: mailbox.Disarm(i, request.requester))
        return _response("disarm", reply)

    def start_behavior(self, request: Message) -> Message:
        arguments = from_parameters(request.arguments)
        reply = self._flight.ask(
            lambda i: mailbox.StartBehavior(i, request.requester, request.name, arguments)
        )
        return _response("start_behavior", reply)

    def emergency(self, request: Message) -> Message:
        reply = self._flight.ask(lambda i: mailbox.Emergency(i, request.requester, request.action))
        return _response("emergency", reply)

    def bench(self, request: Message) -> Message:
        reply = self._flight.ask(
            lambda i: mailbox.Bench(
                i,
                request.requester,
                int(request.motor),
                int(request.reference),
                bool(request.secured),
            )
        )
        return _response("bench", reply)

    def change_parameters(self, request: Message) -> Message:
        values = from_parameters(request.parameters)
        applied, revision = self._parameters.change(values, request.requester)
        return new(
            f"{SERVICES['change_parameters']}_Response",
            accepted=True,
            applied=to_parameters(applied),
            revision=revision,
        )


def _response(service: str, reply: mailbox.Reply) -> Message:
    return new(f"{SERVICES[service]}_Response", accepted=reply.accepted, reason=reply.reason)
