"""The vehicle's end of the lane, wired: keys by a service, topics out and in.

What stations send by the lane comes over Zenoh as well, where ROS 2 nodes publish it too; of both
the first counts, and nothing older than what came. The lane alone keeps the order between topics:
over Zenoh each has a thread of its own.
"""

from __future__ import annotations

import threading
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
    came: told of all that came by the lane once it, and what its sender sent before it, has been
        handed on.
    """

    def __init__(
        self,
        node: Node,
        port: int,
        came: Callable[[str, Received], None] = lambda topic, received: None,
    ) -> None:
        self._node = node
        self._newest = NewestOnly()
        self._take: dict[str, tuple[threading.Lock, Callable[[Received], None]]] = {}
        self._came = came
        self._lane = VehicleLane(port, self._by_lane)
        for door, topics in ((PILOT_LANE, TO_VEHICLE), (LANE, (HELLO,))):
            node.serve(door, SERVICES[LANE], self._granting(topics))

    def send(self, publishers: Mapping[str, Publisher], beats_every: int = 1) -> None:
        """Send what these publish by the lane too, as far as it belongs to the lane's topics.

        Args:
            beats_every: of the heartbeats sent by it, one in so many goes over Zenoh too.
        """
        for name in TO_STATION:
            publishers[name].beside = partial(self._lane.put, name)
        publishers["vehicle_heartbeat"].every = beats_every

    def take(self, topic: str, callback: Callable[[Received], None]) -> None:
        """Deliver each message of a topic once and in order, whichever way it comes first."""
        self._take[topic] = threading.Lock(), callback
        row = TOPICS[topic]
        self._node.subscribe(topic, row.type_name, partial(self._deliver, topic))

    def _granting(self, topics: tuple[str, ...]) -> Callable[[Message], Message]:
        """Return a service that grants new keys each time it is asked; `topics` is what their owner
        may send.
        """
        return lambda request: self._lane.grant(int(request.instance), topics)

    def close(self) -> None:
        self._lane.close()

    def _by_lane(self, topic: str, received: Received) -> None:
        self._deliver(topic, received)
        self._came(topic, received)

    def _deliver(self, topic: str, received: Received) -> None:
        taken = self._take.get(topic)
        if taken is None:
            return
        one_at_a_time, callback = taken
        with one_at_a_time:  # what came the other way has been handed on, not only seen
            if self._newest.is_newer(topic, received):
                callback(received)
