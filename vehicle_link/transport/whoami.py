"""The vehicle's answer to who it is, and to what access the asking station has."""

from __future__ import annotations

from quadrotor.errors import LinkError
from vehicle_link.identity import Identity
from vehicle_link.messages import Message, new
from vehicle_link.messages.records import WhoAmIRequest, WhoAmIResponse
from vehicle_link.security.access import PILOT_WHOAMI, WHOAMI, Access
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.node import Node
from vehicle_link.transport.protocol import protocol, version

TYPE = SERVICES["whoami"]
DISCOVERY_TIMEOUT = 0.3
"""Seconds to wait for the pilot's service once the other is discovered: both are announced at once,
unless one is hidden."""
SERVICE_BY_ACCESS: dict[Access, str] = {"pilot": PILOT_WHOAMI, "observer": WHOAMI}


def serve_whoami(node: Node, name: str, instance: int, identity: Identity) -> None:
    """Serve the vehicle's identity under two services, as an observer can reach only one of
    them.
    """
    for access, service in SERVICE_BY_ACCESS.items():
        answer = new(
            f"{TYPE}_Response",
            name=name,
            role="vehicle",
            access=access,
            instance=instance,
            protocol=protocol(),
            version=version(),
            robot_id=identity.robot_id,
            firmware=identity.firmware,
        )

        def handle(request: WhoAmIRequest, answer: Message = answer) -> Message:
            return answer

        node.serve(service, TYPE, handle)


class WhoAmI:
    """Client of the service `whoami`."""

    def __init__(self, node: Node) -> None:
        self._clients = [node.client(service, TYPE) for service in SERVICE_BY_ACCESS.values()]

    @property
    def is_there(self) -> bool:
        """Return whether the vehicle has this service in our version."""
        return self._clients[1].wait(0.0)

    def ask(self, timeout: float = 1.0) -> WhoAmIResponse:
        """Return quadlab_msgs/srv/WhoAmI's response, of the available service of widest access.

        Raises LinkError when there is no answer.
        """
        pilot, observer = self._clients
        request = new("quadlab_msgs/srv/WhoAmI_Request")
        if not self.is_there:
            raise LinkError("the vehicle does not identify itself")
        return (pilot if pilot.wait(DISCOVERY_TIMEOUT) else observer).call(request, timeout)
