"""The vehicle's end of the datagram lane: a service for its keys, and topics in both directions.

Poses and bearings are subscribed to over Zenoh only while nothing arrives by the lane from the
station that holds the vehicle, so that they cross the radio once. Heartbeats and sticks always
arrive both ways; the first copy counts, and older ones are dropped. Only the lane preserves the
order between topics: over Zenoh each topic has its own thread.
"""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable
from functools import partial

from quadrotor.errors import LinkError
from vehicle_link.addresses import EVERYWHERE
from vehicle_link.clock import monotonic
from vehicle_link.lane.datagram import HELLO, TO_STATION, TO_VEHICLE
from vehicle_link.lane.lane_alone import LaneAlone
from vehicle_link.lane.replay_window import NewestOnly
from vehicle_link.lane.vehicle_lane import VehicleLane
from vehicle_link.messages import Message
from vehicle_link.messages.records import LaneRequest
from vehicle_link.security.access import LANE, PILOT_LANE
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import OtherPath, Received

log = logging.getLogger(__name__)

ONE_WAY = ("tracker_pose", "tracker_position", "bearings")
"""Topics that are subscribed to over Zenoh only while the lane is silent."""
HEARTBEAT = "station_heartbeat"
DEAF_AFTER = 2.0
"""Seconds of heartbeats by the lane alone after which this process counts as deaf."""
SILENT_AFTER = 0.3
"""Seconds without a heartbeat by the lane, after which several are missing."""
CHECK_EVERY = 0.05  # s


class CommsLane:
    """Lane of one vehicle.

    Args:
        port: UDP port; another one if it is in use.
        on_message: called with each message of the lane, after it and those that its sender sent
            before it have been handled.
    """

    def __init__(
        self,
        node: Node,
        port: int,
        on_message: Callable[[str, Received], None] = lambda topic, received: None,
        host: str = EVERYWHERE,
    ) -> None:
        self._node = node
        self._newest = NewestOnly()
        self._callbacks: dict[str, tuple[threading.Lock, Callable[[Received], None]]] = {}
        self._on_message = on_message
        self._received = -math.inf
        self._alone = LaneAlone()
        self._over_zenoh: Node | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(
            target=self._keep_subscriptions, name="lane keeper", daemon=True
        )
        self._lane = VehicleLane(port, self._by_lane, host)
        for service, topics in ((PILOT_LANE, TO_VEHICLE), (LANE, (HELLO,))):
            node.serve(service, SERVICES[LANE], self._granting(topics))

    def paths(self, beats_every: int = 1) -> dict[str, OtherPath]:
        """Return the paths by the lane of the topics that it carries to the station.

        Args:
            beats_every: of the heartbeats sent by the lane, one in this many is also sent over
                Zenoh.
        """
        one_in = {"vehicle_heartbeat": beats_every}
        return {
            name: OtherPath(partial(self._lane.send, name), one_in.get(name, 1))
            for name in TO_STATION
        }

    def subscribe(self, topic: str, callback: Callable[[Received], None]) -> None:
        """Deliver each message of a topic once and in order, by whichever way it arrives first."""
        self._callbacks[topic] = threading.Lock(), callback
        if topic not in ONE_WAY:
            self._subscribe(self._node, topic)

    def start(self) -> None:
        """Subscribe to the other topics, after `subscribe` was called for all of them."""
        self.update_subscriptions()
        self._thread.start()

    def note_received(self, publisher: bytes = b"") -> None:
        """Note a heartbeat by the lane of the station that holds the vehicle."""
        self._received = monotonic()
        self._alone.by_lane(publisher)

    @property
    def is_deaf(self) -> bool:
        """Return whether the station's heartbeats come by the lane alone, and so no commands."""
        return self._alone.lasted > DEAF_AFTER

    def _subscribe(self, node: Node, topic: str) -> None:
        node.subscribe(topic, TOPICS[topic].type_name, partial(self._by_zenoh, topic))

    def _keep_subscriptions(self) -> None:
        while not self._closing.wait(CHECK_EVERY):
            try:
                self.update_subscriptions()
            except LinkError as error:  # the session is closing
                log.info("lane: %s", error)

    def update_subscriptions(self) -> None:
        """Subscribe over Zenoh to the topics that the lane does not deliver, and to no others."""
        is_received = monotonic() - self._received < SILENT_AFTER
        if is_received and self._over_zenoh is not None:
            self._over_zenoh.close()
            self._over_zenoh = None
        elif not is_received and self._over_zenoh is None:
            # A separate node, because a node can only be closed as a whole.
            name = f"{self._node.name}_measurements"
            node = Node(self._node.session, self._node.namespace, name)
            for topic in filter(self._callbacks.__contains__, ONE_WAY):
                self._subscribe(node, topic)
            self._over_zenoh = node

    def _granting(self, topics: tuple[str, ...]) -> Callable[[LaneRequest], Message]:
        """Return a service that grants new keys on each request, to send only `topics` with."""
        return lambda request: self._lane.grant(int(request.instance), topics)

    def close(self) -> None:
        self._closing.set()
        if self._thread.ident is not None:
            self._thread.join(1.0)
        if self._over_zenoh is not None:
            self._over_zenoh.close()
        self._lane.close()

    def _by_zenoh(self, topic: str, received: Received) -> None:
        if topic == HEARTBEAT:
            self._alone.by_zenoh(received.gid)
        self._deliver(topic, received)

    def _by_lane(self, topic: str, received: Received) -> None:
        self._deliver(topic, received)
        self._on_message(topic, received)

    def _deliver(self, topic: str, received: Received) -> None:
        found = self._callbacks.get(topic)
        if found is None:
            return
        one_at_a_time, callback = found
        with one_at_a_time:  # a message from the other way has been handled, not only received
            if self._newest.is_newer(topic, received):
                callback(received)
