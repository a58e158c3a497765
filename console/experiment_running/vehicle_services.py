"""The vehicle's own services, as called by an experiment."""

from __future__ import annotations

import uuid
from typing import Any

from quadrotor.errors import LinkError, RefusedError
from vehicle_link.messages import new
from vehicle_link.topics import SERVICES
from vehicle_link.transport.node import Node

CALL_TIMEOUT = 1.0
USED = ("arm", "disarm", "start_behavior", "change_parameters", "calibrate", "bench")


class VehicleServices:
    """Clients of the vehicle's services; may be called from several threads. Created once, because
    each client announces itself.
    """

    def __init__(self, node: Node) -> None:
        self._clients = {name: node.client(name, SERVICES[name]) for name in USED}

    def call(
        self,
        service: str,
        requester: str,
        *,
        timeout: float = CALL_TIMEOUT,
        tries: int = 2,
        **fields: Any,
    ) -> Any:
        """Return the accepted answer; a lost one is requested again with the same id. Raises
        RefusedError or LinkError.

        Args:
            timeout: s for each try.
        """
        request = new(
            f"{SERVICES[service]}_Request",
            request_id=uuid.uuid4().hex,
            requester=requester,
            **fields,
        )
        for left in reversed(range(tries)):
            try:
                response = self._clients[service].call(request, timeout=timeout)
                break
            except LinkError:
                if not left:
                    raise
        if not response.accepted:
            raise RefusedError(str(response.reason) or f"{service} was refused without a reason")
        return response
