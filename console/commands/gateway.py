"""The station's services: commands for the vehicle are forwarded, the others are answered here.

The requester's name is forwarded too, so that vehicle, log and catalogue have it, and so is the
request id, so that a repeated request has one effect. Each service has its own thread
(vehicle_link.transport.node): an emergency never waits behind another command.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import partial
from typing import TypeVar, cast

from console.parameters.store import PREFIX, StationStore
from quadrotor.errors import LinkError, NoAnswerError, ParameterError, RefusedError
from quadrotor.parameter_description import ParameterValue
from vehicle_link.commands import COMMANDS
from vehicle_link.messages import Message, new
from vehicle_link.messages.records import (
    Answer,
    ChangeParametersRequest,
    ChangeParametersResponse,
    CommandRequest,
    PersonalRequest,
    RecordRequest,
    Request,
    SimulationRequest,
    StartBehaviorRequest,
)
from vehicle_link.parameters.change import SIMULATOR, authority_of
from vehicle_link.parameters.messages import from_parameters, to_parameters
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.client import ServiceClient
from vehicle_link.transport.idempotent import Idempotent
from vehicle_link.transport.node import Node

A = TypeVar("A", bound=Message)
AT_ONCE = 4
"""Maximum number of simultaneous requests of one service: a cut does not wait behind a landing that
the vehicle does not answer, nor a landing behind a take-off."""


class CommandGateway:
    """Serves `/<vehicle>/station/{arm, …, change_parameters, record}`.

    Args:
        refusal: returns why a command is not sent to the vehicle now, or "".
        deadline_ns: returns the vehicle's time in so many seconds; 0 when it is not known.
        record: (start, requester) → run id; raises StorageError with the reason.
        permit: called first with (command, requester); raises RefusedError with the reason.
        on_asked: called with (command, requester) before a command is forwarded.
        on_started: called with a behavior and its arguments when the vehicle has accepted it.
    """

    def __init__(
        self,
        node: Node,
        store: StationStore,
        refusal: Callable[[str], str],
        deadline_ns: Callable[[float], int],
        record: Callable[[bool, str], str],
        permit: Callable[[str, str], None],
        on_asked: Callable[[str, str], None],
        on_started: Callable[[str, Mapping[str, ParameterValue]], None] = lambda name, given: None,
    ) -> None:
        self._node, self._store = node, store
        self._refusal = refusal
        self._deadline_ns = deadline_ns
        self._record = record
        self._permit = permit
        self._on_asked, self._on_started = on_asked, on_started
        change = "change_parameters"
        self._simulator = node.client(f"simulator/{change}", SERVICES[change])
        self._forwarded = [command for command in COMMANDS.values() if command.is_forwarded]
        self._clients = {c.name: node.client(c.address, c.service) for c in self._forwarded}

    def serve(self) -> None:
        """Answer commands from now on."""
        for command in self._forwarded:
            serve = partial(
                self._node.serve, f"station/{command.name}", command.service, at_once=AT_ONCE
            )
            if command.name == "change_parameters":
                serve(self._change_parameters)
            else:
                serve(partial(self._forward, command.name))
        # Only here: a repeated command must reach the vehicle when the first one did not.
        self._node.serve("station/record", SERVICES["record"], Idempotent(self._start_or_stop))

    def _forward(self, name: str, request: PersonalRequest[A]) -> A:
        # Sent into a lost link it may be carried out late, by surprise.
        if COMMANDS[name].at == "vehicle" and (reason := self._refusal(name)):
            raise RefusedError(reason)
        self._permit(name, request.requester)
        self._on_asked(name, request.requester)
        if name == "simulation" and cast("SimulationRequest", request).action == "reset":
            self._announce_move(request.request_id, request.requester)
        answer = self._ask(name, request)
        if name == "start_behavior" and cast("Answer", answer).accepted:
            started = cast("StartBehaviorRequest", request)
            self._on_started(started.name, from_parameters(started.arguments))
        return answer

    def _announce_move(self, request_id: str, requester: str) -> None:
        """Announce a reset to the vehicle, which would report it as a jump of the tracker.

        The reset does not depend on it, for instance while the link is lost.
        """
        name = "expect_move"
        move = new(
            "quadlab_msgs/srv/Command_Request", request_id=f"{request_id}-move", requester=requester
        )
        if not self._refusal(name):
            with suppress(NoAnswerError, RefusedError):
                self._ask(name, move)

    def _ask(self, name: str, request: PersonalRequest[A]) -> A:
        """Return the answer of the process that carries out the command.

        Raises NoAnswerError, which is no refusal: the outcome of the command is unknown. Raises
        RefusedError when link or control are lost in the meantime.
        """
        patience, tries = COMMANDS[name].patience, COMMANDS[name].tries
        if hasattr(request, "valid_until_ns"):  # not once its sender has been told of no answer
            cast("CommandRequest", request).valid_until_ns = self._deadline_ns(patience)
        began, asked = time.monotonic(), 0
        while True:
            try:
                return _answer(self._clients[name], request, patience)
            except NoAnswerError:
                asked += 1
                if asked == tries:
                    raise
            time.sleep(max(0.0, began + patience * asked - time.monotonic()))
            if reason := self._refusal(name):
                raise RefusedError(reason)
            self._permit(name, request.requester)

    def _change_parameters(self, request: ChangeParametersRequest) -> ChangeParametersResponse:
        """Change the station's parameters here and all others on the vehicle; all or nothing."""
        name = "change_parameters"
        self._permit(name, request.requester)
        values = from_parameters(request.parameters)
        own = {key: value for key, value in values.items() if key.startswith(PREFIX)}
        self._store.tried(own)
        if any(authority_of(key) == SIMULATOR for key in values):
            return self._change_simulator(request, values)
        applied, revision = {}, self._store.revision
        others = {key: value for key, value in values.items() if key not in own}
        if others:
            passed_on = new(
                "quadlab_msgs/srv/ChangeParameters_Request",
                request_id=request.request_id,
                requester=request.requester,
                parameters=to_parameters(others),
            )
            response = self._forward(name, passed_on)
            if not response.accepted:
                return response
            applied, revision = from_parameters(response.applied), int(response.revision)
        if own:
            mine, own_revision = self._store.change(own, request.requester)
            applied = {**applied, **mine}
            revision = revision if others else own_revision
        return new(
            "quadlab_msgs/srv/ChangeParameters_Response",
            accepted=True,
            applied=to_parameters(applied),
            revision=revision,
        )

    def _change_simulator(
        self, request: ChangeParametersRequest, names: Iterable[str]
    ) -> ChangeParametersResponse:
        """Change parameters of the simulator. Raises ParameterError, NoAnswerError."""
        others = [name for name in names if authority_of(name) != SIMULATOR]
        if others:
            raise ParameterError(
                f"{others[0]} and parameters of the simulator cannot be changed in one request; "
                "change them separately"
            )
        return _answer(self._simulator, request, COMMANDS["change_parameters"].patience)

    def _start_or_stop(self, request: RecordRequest) -> Message:
        self._permit("record", request.requester)
        run_id = self._record(bool(request.start), request.requester)
        return new(f"{SERVICES['record']}_Response", accepted=True, run_id=run_id)


def _answer(client: ServiceClient[Answer], request: Request[A], timeout: float) -> A:
    """Return the answer. Raises NoAnswerError for every failure: the command may have been carried
    out.
    """
    try:
        return client.call(request, timeout=timeout)
    except NoAnswerError:
        raise
    except LinkError as error:
        raise NoAnswerError(str(error)) from error
