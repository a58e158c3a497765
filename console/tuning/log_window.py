"""Requests about the vehicle's log, forwarded by the station at the lowest priority."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from quadrotor.errors import LinkError, RefusedError
from vehicle_link.topics import SERVICES
from vehicle_link.transport.heartbeat import LinkState
from vehicle_link.transport.node import Node

TYPE = SERVICES["onboard_log"]
TIMEOUT = 1.0
"""Timeout in s; clients of the station wait a little longer."""


class LogWindow:
    """Serves `/<vehicle>/station/onboard_log`.

    Requests and answers are of background priority: messages of the flight go first on the radio.

    Args:
        link_state: returns the state of the link to the vehicle.
    """

    def __init__(self, node: Node, link_state: Callable[[], LinkState]) -> None:
        self._link_state = link_state
        self._client = node.client("onboard_log", TYPE, priority="background")
        node.serve("station/onboard_log", TYPE, self._ask)

    def _ask(self, request: Any) -> Any:
        if self._link_state() is LinkState.LOST:
            raise RefusedError("the link to the vehicle is lost; its log cannot be read")
        try:
            return self._client.call(request, timeout=TIMEOUT)
        except LinkError as error:
            raise RefusedError(str(error)) from error
