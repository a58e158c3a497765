"""Node of the web process on the station's loopback router: subscriptions and service calls.

The session is opened in a thread, which keeps trying: while the station is away, the page works and
shows the age of everything. Calls run in separate threads, some of them reserved for emergencies.
"""

from __future__ import annotations

import asyncio
import threading
import time
import uuid
from collections.abc import Callable, Collection, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from quadrotor.errors import LinkError, RefusedError, UnreachableError
from quadrotor.parameter_description import ParameterDescription, ParameterValue
from vehicle_link.clock import host_time_ns, wall_time
from vehicle_link.commands import COMMANDS, EventKind
from vehicle_link.messages import decode, encode, header, new, stamp_of
from vehicle_link.messages.records import Answer
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.parameters.messages import decode_change, from_parameters, to_parameters
from vehicle_link.topics.status import event_kinds
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.topics.ticks import TICK_TOPICS
from web.latest import FAST, STALE, TICKS, Live
from web.live.events import LEVELS, SUMMARY_NOW, EventHub, event
from web.live.optional_topics import OptionalTopics, subscribe_directly

if TYPE_CHECKING:
    from vehicle_link.transport.client import ServiceClient
    from vehicle_link.transport.loopback import Session
    from vehicle_link.transport.node import Node
    from vehicle_link.transport.parameter_service import ParameterClient
    from vehicle_link.transport.publisher import Publisher, Received

CALL_TIMEOUT = 1.5  # s
PATIENCE = {
    **{name: command.tries * command.patience + 0.5 for name, command in COMMANDS.items()},
    "checks": 8.0,
    "experiment": 4.0,
    "onboard_files": 4.0,
}
"""Timeouts, in s, of slow services: a little longer than the station waits for the vehicle."""
RETRY = 1.0  # s
JOY = "sensor_msgs/Joy"

Described = tuple[list[ParameterDescription], dict[str, ParameterValue]]


class Reactions(NamedTuple):
    """The functions that are called, on Zenoh's threads, with messages from the station.

    Attributes:
        changed: called with each change of a parameter.
        stick_answered: called with the stamp (ns) of sticks, whether they count, and why not.
    """

    changed: Callable[[ParameterChange], None] = lambda _: None
    stick_answered: Callable[[int, bool, str], None] = lambda *_: None


class Station:
    """Client of the station for one vehicle.

    Fast topics are subscribed to only while `watch` requests them.

    Args:
        open_session: returns a Zenoh session or raises LinkError.
        close_session: closes the session that `open_session` returned; may block for long.
    """

    def __init__(
        self,
        open_session: Callable[[], Session],
        vehicle: str,
        live: Live,
        hub: EventHub,
        reactions: Reactions,
        close_session: Callable[[Session], None] = lambda session: session.close(),
    ) -> None:
        self._open_session, self._close_session = open_session, close_session
        self._watched = OptionalTopics(vehicle, "web_", complete=True)
        self._forwarded = OptionalTopics(vehicle, "web_forwards_")
        self._vehicle = vehicle
        self._live = live
        self._hub = hub
        self.reactions = reactions
        self._link_said = ""
        self._node: Node | None = None
        self._own: dict[str, Publisher] = {}  # of the topics that this process sends
        self._clients: dict[str, ServiceClient[Answer]] = {}
        self._parameters: dict[str, ParameterClient] = {}
        self._making = threading.Lock()
        self._closing = threading.Event()
        self._callers = ThreadPoolExecutor(16, thread_name_prefix="web-call")
        self._urgent = ThreadPoolExecutor(4, thread_name_prefix="web-emergency")
        self._opener = threading.Thread(target=self._open, name="web-session", daemon=True)

    def start(self) -> None:
        self._opener.start()

    def stop(self) -> None:
        self._closing.set()
        self._opener.join(timeout=1.0)
        if self._node is not None:
            # Closing a session whose router died can block for long; the process must not wait.
            closer = threading.Thread(target=self._close, args=(self._node,), daemon=True)
            closer.start()
            closer.join(timeout=1.0)
        self._callers.shutdown(wait=False, cancel_futures=True)
        self._urgent.shutdown(wait=False, cancel_futures=True)

    def watch(self, topics: Collection[str]) -> None:
        """Subscribe to these of the topics in `FAST` and to no others. Blocks for some ms."""
        wanted = {TICKS if topic in TICK_TOPICS else topic for topic in topics}
        self._watched.want({topic: partial(self._put, topic) for topic in wanted})

    def forward(self, topics: Mapping[str, Callable[[Received], None]]) -> None:
        """Subscribe to these topics and no others.

        Each message is passed to its function on Zenoh's thread. Blocks for some ms.
        """
        self._forwarded.want(topics)

    async def command(self, service: str, requester: str, **fields: Any) -> Any:
        """Call one of the station's services and return its answer.

        Raises RefusedError with the reason, or LinkError.
        """
        fields.setdefault("request_id", uuid.uuid4().hex)
        sent = {k: to_parameters(v) if isinstance(v, dict) else v for k, v in fields.items()}
        executor = self._urgent if service == "emergency" else self._callers
        request = new(f"{SERVICES[service]}_Request", requester=requester, **sent)
        response = await asyncio.get_running_loop().run_in_executor(
            executor, self._call_blocking, service, request
        )
        if not response.accepted:
            raise RefusedError(response.reason or f"{service} was refused without a reason")
        return response

    async def change_parameters(
        self, values: Mapping[str, ParameterValue], requester: str
    ) -> tuple[dict[str, ParameterValue], int]:
        """Change parameters; return the applied values and the revision.

        Raises RefusedError or LinkError.
        """
        response = await self.command("change_parameters", requester, parameters=dict(values))
        return from_parameters(response.applied), int(response.revision)

    async def read_parameters(self, remote: str) -> Described:
        """Return the descriptions and values of all of a node's parameters.

        Args:
            remote: the node (`/quad1/vehicle`).

        Raises LinkError.
        """
        return await asyncio.get_running_loop().run_in_executor(
            self._callers, self._read_parameters, remote
        )

    async def has_parameters(self, remote: str) -> bool:
        """Return whether the parameter services of that node answer."""
        try:
            await asyncio.get_running_loop().run_in_executor(
                self._callers, lambda: self._parameter_client(remote).names()
            )
        except LinkError:
            return False
        return True

    def has_checked(self) -> bool:
        """Return whether the station has made its start-up checks and reported them. Blocks."""
        request = new(f"{SERVICES['checks']}_Request", request_id=uuid.uuid4().hex)
        try:
            return bool(self._call_blocking("checks", request).checked)
        except LinkError:  # not there yet
            return False

    def _read_parameters(self, remote: str) -> Described:
        client = self._parameter_client(remote)
        return client.describe(), client.values()

    def _parameter_client(self, remote: str) -> ParameterClient:
        from vehicle_link.transport.parameter_service import ParameterClient

        node = self._require_node()
        with self._making:
            if remote not in self._parameters:
                self._parameters[remote] = ParameterClient(node, remote)
        return self._parameters[remote]

    def publish_stick(
        self, axes: tuple[float, float, float, float], enabled: bool, requester: str
    ) -> int:
        """Publish forward, left, up, yaw in -1..1; the station checks, watches and forwards them.

        Return the stamp (ns) that the station's answer will have; 0 if there is no station.
        """
        if not self._own:
            return 0
        now = host_time_ns()
        message = new(JOY, header=header(now, requester), axes=axes, buttons=[int(enabled)])
        self.publish("stick", encode(message), now)
        return now

    def publish_presence(self, labels: Iterable[str]) -> None:
        """Publish the labels of the people who have a page open."""
        self.publish("presence", encode(new("quadlab_msgs/Presence", names=list(labels))))

    def publish(self, topic: str, payload: bytes, stamp_ns: int | None = None) -> None:
        """Publish a message of a topic of which this process is the sender in the table; nothing
        while there is no station.

        Args:
            stamp_ns: source time in ns; now when not given.

        Raises LinkError if the session is closed.
        """
        if (publisher := self._own.get(topic)) is not None:
            publisher.put(payload, stamp_ns)

    def _call_blocking(self, service: str, request: Any) -> Any:
        node = self._require_node()
        with self._making:  # ROS 2 learns of each client: make one a service, not a call
            if service not in self._clients:
                self._clients[service] = node.client(f"station/{service}", SERVICES[service])
        return self._clients[service].call(request, timeout=PATIENCE.get(service, CALL_TIMEOUT))

    def _require_node(self) -> Node:
        if self._node is None:
            raise UnreachableError("the base station cannot be reached; is it running?")
        return self._node

    def _open(self) -> None:
        """Open session, node and subscriptions; retry until it works."""
        is_reported = False
        while not self._closing.is_set():
            try:
                session = self._open_session()
            except LinkError as error:
                if not is_reported:
                    message = event("warn", f"{error}; trying again", "web", time.time())
                    self._hub.publish_from_thread(message)
                is_reported = True
                self._closing.wait(RETRY)
                continue
            self._join(session)
            return

    def _join(self, session: Session) -> None:
        from vehicle_link.transport.node import Node

        node = Node(session, f"/{self._vehicle}", "web")
        for topic in STALE.keys() - FAST - {"link_status"}:
            subscribe_directly(node, topic, partial(self._put, topic))
        reactions = (
            ("events", self._on_event),
            ("parameter_changes", self._on_change),
            ("marks", self._on_mark),
            ("link_status", self._on_link),
            ("stick_status", self._on_stick_status),
        )
        for topic, react in reactions:
            node.subscribe(topic, TOPICS[topic].type_name, react, qos=TOPICS[topic].qos)
        encode(new(JOY))  # serialisers are generated on first use, which takes up to 0.1 s
        own = (row for row in TOPICS.values() if row.sender == "web")
        self._own = {row.name: node.advertise(row) for row in own}
        self._watched.join(session)
        self._forwarded.join(session)
        self._node = node

    def _put(self, topic: str, received: Received) -> None:
        self._live.put(topic, received.payload, received.source_ns)

    def _on_link(self, received: Received) -> None:
        """Show pages a broken link at once, not with the next summary."""
        self._put("link_status", received)
        state = decode(received.payload, TOPICS["link_status"].type_name).state
        if state != self._link_said:
            self._link_said = state
            self._hub.publish_from_thread(SUMMARY_NOW)

    def _on_event(self, received: Received) -> None:
        log = decode(received.payload, "rcl_interfaces/Log")
        level = LEVELS.get(int(log.level), "info")
        time = log.stamp.sec + 1e-9 * log.stamp.nanosec or None
        is_act = EventKind.ACT in event_kinds(log)
        said = event(level, log.msg, log.name or self._vehicle, wall_time(), time, is_act=is_act)
        self._hub.publish_from_thread(said)

    def _on_stick_status(self, received: Received) -> None:
        status = decode(received.payload, TOPICS["stick_status"].type_name)
        self.reactions.stick_answered(stamp_of(status), bool(status.enabled), str(status.reason))

    def _on_mark(self, received: Received) -> None:
        mark = decode(received.payload, "quadlab_msgs/Mark")
        fields = {name: getattr(mark, name) for name in ("id", "run_id", "text", "requester")}
        self._hub.publish_from_thread({"type": "mark", **fields, "time": float(mark.time)})

    def _on_change(self, received: Received) -> None:
        self.reactions.changed(decode_change(received.payload))

    def _close(self, node: Node) -> None:
        self._watched.close()
        self._forwarded.close()
        node.close()
        self._close_session(node.session)
