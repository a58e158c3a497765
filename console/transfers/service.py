"""Services and topic of the transfers, and the list of the vehicle's files."""

from __future__ import annotations

from console.catalogue.catalogue import Catalogue
from console.context import StationContext
from console.link.forwarding import forward_service
from console.transfers.job import KINDS
from console.transfers.transfer_queue import TransferQueue
from console.transfers.vehicle_files import TIMEOUT, VehicleFiles
from quadrotor.errors import RefusedError
from vehicle_link.messages import new
from vehicle_link.messages.records import Message, TransferRequest
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport.idempotent import Idempotent

BEATS = 10
"""Heartbeats of the station (20 Hz) between two progress messages."""


class Transfers:
    """The services and the topic of the transfers; works from its creation on."""

    def __init__(self, context: StationContext, catalogue: Catalogue) -> None:
        node, self._link = context.node, context.link
        self.queue = TransferQueue(
            catalogue,
            context.vehicle,
            VehicleFiles(node),
            self._link.state,
            context.parameters.recorder,
            context.outbox.say,
        )
        self._publisher = node.advertise(TOPICS["transfers"])
        node.serve("station/transfer", SERVICES["transfer"], Idempotent(self._transfer))
        forward_service(node, "onboard_files", self._link.state, TIMEOUT)
        self.queue.start()

    def close(self) -> None:
        self.queue.close()

    def tick(self, count: int) -> None:
        """Publish the transfers; called on each heartbeat. Raises LinkError when the session is
        closed.
        """
        if count % BEATS == 0:
            stamp_ns = self._link.vehicle_ns()
            if (payload := self.queue.message(stamp_ns)) is not None:
                self._publisher.put(payload, stamp_ns)

    def _transfer(self, request: TransferRequest) -> Message:
        name, number = str(request.name), 0
        if request.action == "cancel":
            self.queue.cancel(name)
        elif request.action in KINDS:
            number = self.queue.ask(KINDS[request.action], name, by_person=True)
        else:
            raise RefusedError(
                f"transfer: no action {request.action!r:.40}; allowed are download, backfill and "
                "cancel"
            )
        return new(f"{SERVICES['transfer']}_Response", accepted=True, id=number)
