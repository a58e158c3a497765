"""Requests about the vehicle's log, forwarded by the station at the lowest priority."""

from __future__ import annotations

from collections.abc import Callable

from quadrotor.errors import LinkError, RefusedError
from vehicle_link.messages.records import Answer, PersonalRequest
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.heartbeat import LinkState
from vehicle_link.transport.node import Node


def forward_service(
    node: Node, name: str, link_state: Callable[[], LinkState], timeout: float
) -> None:
    """Serve `/<vehicle>/station/<name>` with the vehicle's own answers.

    Requests and answers are of background priority: messages of the flight go first on the radio.

    Args:
        link_state: returns the state of the link to the vehicle.
        timeout: s; clients of the station wait a little longer.
    """
    client = node.client(name, SERVICES[name], priority="background")

    def ask(request: PersonalRequest[Answer]) -> Answer:
        if link_state() is LinkState.LOST:
            raise RefusedError("the link to the vehicle is lost; its log cannot be read")
        try:
            return client.call(request, timeout=timeout)
        except LinkError as error:
            raise RefusedError(str(error)) from error

    node.serve(f"station/{name}", SERVICES[name], ask)
