"""The vehicle's end of the lane, wired: keys by a service, topics out and in.

What stations send by the lane comes over Zenoh as well, where ROS 2 nodes publish it too; of both
the first counts, and nothing older than what came.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from vehicle_link.lane.datagram import HELLO, TO_STATION, TO_VEHICLE
from vehicle_link.lane.newest_only import NewestOnly
from vehicle_link.lane.vehicle_lane import VehicleLane
from vehicle_link.messages import Message
from vehicle_link.security.access import LANE, PILOT_LANE
from vehicle_link.topics import SERVICES, TOPICS
from vehicle_link.transport.node import Node, Publisher, Received


class CommsLane:
    """Args:
    port: UDP; another when it is taken.
    """

    def __init__(self, node: Node, port: int) -> None:
        self._node = node
        self._newest = NewestOnly()
        self._take: dict[str, Callable[[Received], None]] = {}
        self._lane = VehicleLane(port, self._deliver)
        for door, topics in ((PILOT_LANE, TO_VEHICLE), (LANE, (HELLO,))):
            node.serve(door, SERVICES[LANE], self._granting(topics))

    def send(self, publishers: Mapping[str, Publisher], beats_every: int = 1) -> None:
        """What these publish goes by the lane too, as far as it is of the lane's topics.

        Args:
            beats_every: of the heartbeats sent by it, one in so many goes over Zenoh too.
        """
        for name in TO_STATION:
            publishers[name].beside = partial(self._lane.put, name)
        publishers["vehicle_heartbeat"].every = beats_every

    def take(self, topic: str, callback: Callable[[Received], None]) -> None:
        """Each message of a topic once and in order, whichever way it comes first."""
        self._take[topic] = callback
        row = TOPICS[topic]
        self._node.subscribe(topic, row.type_name, partial(self._deliver, topic))

    def _granting(self, topics: tuple[str, ...]) -> Callable[[Message], Message]:
        """New keys, each time it is asked; `topics` is what their owner may send."""
        return lambda request: self._lane.grant(int(request.instance), topics)

    def close(self) -> None:
        self._lane.close()

    def _deliver(self, topic: str, received: Received) -> None:
        callback = self._take.get(topic)
        if callback is not None and self._newest.is_newer(topic, received):
            callback(received)
