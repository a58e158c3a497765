"""The station's end of the lane to its vehicle, with all messages in both directions.

Telemetry is subscribed to over Zenoh only while the lane is down, so that it crosses the radio
once. Heartbeats always use both paths: each shows whether its path works. Poses, bearings and
sticks from any publisher on the base, and our heartbeats, are sent over the lane as well as over
Zenoh; the vehicle uses whichever arrives first.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial

from console.link.monitor import LinkMonitor
from console.link.permission import OBSERVER
from vehicle_link.lane.datagram import HELLO, TO_VEHICLE
from vehicle_link.lane.replay_window import ReplayWindow
from vehicle_link.lane.station_lane import StationLane
from vehicle_link.messages import new
from vehicle_link.messages.records import LaneResponse
from vehicle_link.security.access import LANE, PILOT_LANE
from vehicle_link.topics.control_inputs import decode_heartbeat
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received
from vehicle_link.transport.whoami import DISCOVERY_TIMEOUT

DATAGRAM, QUIC = "datagram", "quic"
HEARTBEAT = "station_heartbeat"
TYPE = SERVICES[LANE]


class LaneClient:
    """Client of the vehicle's lane service: of the one for pilots, unless that is not visible."""

    def __init__(self, node: Node, instance: int) -> None:
        self._pilot, self._observer = node.client(PILOT_LANE, TYPE), node.client(LANE, TYPE)
        self._request = new(
            "quadlab_msgs/srv/Lane_Request", requester=node.full_name, instance=instance
        )

    def request_keys(self) -> LaneResponse:
        """Request keys for a lane from the vehicle. Raises LinkError."""
        client = self._pilot if self._pilot.wait(DISCOVERY_TIMEOUT) else self._observer
        return client.call(self._request)


class VehicleLane:
    """The lane of one vehicle.

    Args:
        node: of the station, in the vehicle's namespace.
        host: of the vehicle, as it is dialled; empty for no lane.
        telemetry, heartbeat: called with each message, once; never two at a time.
    """

    def __init__(
        self,
        node: Node,
        host: str,
        link: LinkMonitor,
        telemetry: Callable[[Received], None],
        heartbeat: Callable[[Received], None],
    ) -> None:
        self._node, self._link = node, link
        self._callbacks = {"telemetry": telemetry, "vehicle_heartbeat": heartbeat}
        self._windows: dict[tuple[str, bytes], ReplayWindow] = {}
        """Windows by topic and publisher, which numbers its messages equally on both paths."""
        self._one_at_a_time = {name: threading.Lock() for name in self._callbacks}
        self._lane: StationLane | None = None
        self._over_zenoh: Node | None = None
        self._subscribe("vehicle_heartbeat", node)
        self._set_lane_up(False)
        if host:
            client = LaneClient(node, link.permission.instance)
            self._lane = StationLane(host, client.request_keys, self._by_lane, self._set_lane_up)
            for name in TO_VEHICLE:
                if name not in (HELLO, HEARTBEAT):
                    send = partial(self._send, self._lane, name)
                    node.subscribe(name, TOPICS[name].type_name, send, direct=True)

    def close(self) -> None:
        if self._lane is not None:
            self._lane.close()
        if self._over_zenoh is not None:
            self._over_zenoh.close()

    def _subscribe(self, name: str, node: Node) -> None:
        row = TOPICS[name]
        node.subscribe(name, row.type_name, partial(self._by_zenoh, name), qos=row.qos)

    def _set_lane_up(self, is_up: bool) -> None:
        """Note whether the lane is up."""
        if is_up and self._over_zenoh is not None:
            self._over_zenoh.close()
            self._over_zenoh = None
        elif not is_up and self._over_zenoh is None:
            # A separate node, because a node closes as a whole.
            self._over_zenoh = Node(self._node.session, self._node.namespace, "station_telemetry")
            self._subscribe("telemetry", self._over_zenoh)

    @staticmethod
    def _send(lane: StationLane, name: str, received: Received) -> None:
        lane.send(name, received)

    def send_heartbeat(self, received: Received) -> bool:
        """Send one of our heartbeats by the lane; return whether there is one that works."""
        if (lane := self._lane) is None:
            return False
        is_pilot = self._link.permission.access not in ("", OBSERVER)
        return lane.send(HEARTBEAT, received, greets=is_pilot) and lane.is_up

    def _by_lane(self, name: str, received: Received) -> None:
        self._link.note_lane_message()
        self._receive(name, DATAGRAM, received)

    def _by_zenoh(self, name: str, received: Received) -> None:
        self._link.note_session_message()
        if name == "vehicle_heartbeat" and self._lane is not None:
            self._lane.note_vehicle(decode_heartbeat(received.payload).instance)
        self._receive(name, QUIC, received)

    def _receive(self, name: str, path: str, received: Received) -> None:
        with self._one_at_a_time[name]:
            window = self._windows.setdefault((name, received.gid), ReplayWindow())
            if not window.is_new(received.sequence):
                return
            window.mark_received(received.sequence)
            if name == "telemetry":
                self._link.path = path
            self._callbacks[name](received)
