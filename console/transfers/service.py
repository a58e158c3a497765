"""Services and topic of the transfers, and the list of the vehicle's files."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from console.catalogue.catalogue import Catalogue
from console.parameters.station import RecorderParameters
from console.transfers.desk import TransferDesk
from console.transfers.vehicle_files import VehicleFiles
from quadrotor.errors import LinkError, RefusedError
from vehicle_link.messages import new
from vehicle_link.topics import SERVICES, TOPICS
from vehicle_link.transport.heartbeat import LinkState
from vehicle_link.transport.idempotent import Idempotent
from vehicle_link.transport.node import Node

BEATS = 10
"""Heartbeats of the station (20 Hz) between two progress messages."""


class Transfers:
    """The services and the topic of the transfers; works from its creation on.

    Args:
        link_state: returns the state of the link to the vehicle.
        say: publishes an event (level, line).
        vehicle_ns: the vehicle's clock.
    """

    def __init__(
        self,
        node: Node,
        catalogue: Catalogue,
        vehicle: str,
        parameters: RecorderParameters,
        link_state: Callable[[], LinkState],
        say: Callable[[int, str], None],
        vehicle_ns: Callable[[], int],
    ) -> None:
        self._link_state, self._vehicle_ns = link_state, vehicle_ns
        self._files = VehicleFiles(node)
        self.desk = TransferDesk(catalogue, vehicle, self._files, link_state, parameters, say)
        self._publisher = node.advertise(TOPICS["transfers"])
        node.serve("station/transfer", SERVICES["transfer"], Idempotent(self._transfer))
        node.serve("station/onboard_files", SERVICES["onboard_files"], self._list)
        self.desk.start()

    def close(self) -> None:
        self.desk.close()

    def tick(self, count: int) -> None:
        """Publish the transfers; called on each heartbeat. Raises LinkError when the session is
        closed.
        """
        if count % BEATS == 0:
            stamp_ns = self._vehicle_ns()
            if (payload := self.desk.message(stamp_ns)) is not None:
                self._publisher.put(payload, stamp_ns)

    def _transfer(self, request: Any) -> Any:
        name, number = str(request.name), 0
        if request.action == "cancel":
            self.desk.cancel(name)
        elif request.action in ("download", "backfill"):
            number = self.desk.ask(request.action, name, by_person=True)
        else:
            raise RefusedError(
                f"transfer: no action {request.action!r:.40}; allowed are download, backfill and "
                "cancel"
            )
        return new(f"{SERVICES['transfer']}_Response", accepted=True, id=number)

    def _list(self, request: Any) -> Any:
        if self._link_state() is LinkState.LOST:
            raise RefusedError("the link to the vehicle is lost; its logs cannot be listed")
        try:
            return self._files.listed(request)
        except LinkError as error:
            raise RefusedError(str(error)) from error
