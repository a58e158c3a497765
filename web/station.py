"""The web process's node on the station's loopback router: subscriptions and service calls.

The session is opened in a thread and keeps trying: the page works, and says how old everything
is, while the station is away. Calls run in threads of their own, emergencies in one kept free
for them.
"""

from __future__ import annotations

import asyncio
import threading
import time
import uuid
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from quadrotor.errors import LinkError, RefusedError
from quadrotor.parameters import ParameterDescription, ParameterValue
from vehicle_link.messages import decode, encode, header, new
from vehicle_link.parameter_messages import from_parameters, to_parameters
from vehicle_link.topics.table import SERVICES, TOPICS
from web.events import LEVELS, EventHub, event
from web.live import STALE, Live

if TYPE_CHECKING:
    from vehicle_link.client import ServiceClient
    from vehicle_link.node import Node, Publisher, Received
    from vehicle_link.parameter_service import ParameterClient

CALL_TIMEOUT = 1.5  # s; the station gives the vehicle 1 s
ATTEMPTS = {"emergency": 3}  # under the same request id, so that it is done once
RETRY = 1.0  # s

Described = tuple[list[ParameterDescription], dict[str, ParameterValue]]


@dataclass(frozen=True, slots=True)
class Reply:
    """An accepted command's answer; `run_id` only of `record`."""

    run_id: str = ""


class Station:
    """Args: `open_session` returns a Zenoh session or raises LinkError."""

    def __init__(
        self,
        open_session: Callable[[], Any],
        vehicle: str,
        live: Live,
        hub: EventHub,
    ) -> None:
        self._open_session = open_session
        self._vehicle = vehicle
        self._live = live
        self._hub = hub
        self.on_change: Callable[[str, str, str, int], None] = lambda *_: None
        self._node: Node | None = None
        self._stick: Publisher | None = None
        self._clients: dict[str, ServiceClient] = {}
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
            # Closing a session whose router died can block for long; the process need not wait.
            closer = threading.Thread(target=_close, args=(self._node,), daemon=True)
            closer.start()
            closer.join(timeout=1.0)
        self._callers.shutdown(wait=False, cancel_futures=True)
        self._urgent.shutdown(wait=False, cancel_futures=True)

    async def command(self, service: str, requester: str, **fields: Any) -> Reply:
        """Calls one of the station's services. Raises RefusedError with the reason, LinkError."""
        response = await self._call(service, requester, **fields)
        return Reply(run_id=str(getattr(response, "run_id", "")))

    async def answer(self, service: str, requester: str, **fields: Any) -> Any:
        """As `command`, with the whole answer."""
        return await self._call(service, requester, **fields)

    async def start_behavior(
        self, requester: str, name: str, arguments: Mapping[str, ParameterValue], **fields: Any
    ) -> None:
        """The vehicle checks the arguments. Raises RefusedError with its reason, LinkError."""
        sent = to_parameters(arguments)
        await self._call("start_behavior", requester, name=name, arguments=sent, **fields)

    async def change_parameters(
        self, values: Mapping[str, ParameterValue], requester: str
    ) -> tuple[dict[str, ParameterValue], int]:
        """Applied values and the revision. Raises RefusedError or LinkError."""
        response = await self._call(
            "change_parameters", requester, parameters=to_parameters(values)
        )
        return from_parameters(response.applied), int(response.revision)

    async def read_parameters(self, remote: str) -> Described:
        """All of a node's parameters (`/quad1/vehicle`). Raises LinkError."""
        return await asyncio.get_running_loop().run_in_executor(
            self._callers, self._read_parameters, remote
        )

    def _read_parameters(self, remote: str) -> Described:
        from vehicle_link.parameter_service import ParameterClient

        node = self._require_node()
        with self._making:
            if remote not in self._parameters:
                self._parameters[remote] = ParameterClient(node, remote)
        client = self._parameters[remote]
        return client.describe(), client.values()

    def publish_stick(self, axes: tuple[float, float, float, float], enabled: bool) -> None:
        """Forward, left, up, yaw in -1..1; the station stamps, watches and forwards them."""
        if self._stick is not None:
            now = time.time_ns()
            message = new("sensor_msgs/Joy", header=header(now), axes=axes, buttons=[int(enabled)])
            self._stick.put(encode(message), now)

    async def _call(self, service: str, requester: str, **fields: Any) -> Any:
        fields.setdefault("request_id", uuid.uuid4().hex)
        executor = self._urgent if service == "emergency" else self._callers
        request = new(f"{SERVICES[service]}_Request", requester=requester, **fields)
        response = await asyncio.get_running_loop().run_in_executor(
            executor, self._call_blocking, service, request
        )
        if not response.accepted:
            raise RefusedError(response.reason or f"{service} was refused without a reason")
        return response

    def _call_blocking(self, service: str, request: Any) -> Any:
        node = self._require_node()
        with self._making:  # each client announces itself to ROS 2: one a service, not a call
            if service not in self._clients:
                self._clients[service] = node.client(f"station/{service}", SERVICES[service])
        for attempt in range(ATTEMPTS.get(service, 1), 0, -1):
            try:
                return self._clients[service].call(request, timeout=CALL_TIMEOUT)
            except LinkError:
                if attempt == 1:
                    raise

    def _require_node(self) -> Node:
        if self._node is None:
            raise LinkError("the station cannot be reached; is `quadlab station` running?")
        return self._node

    def _open(self) -> None:
        """Until it works: the session, the node, its subscriptions."""
        told = False
        while not self._closing.is_set():
            try:
                session = self._open_session()
            except LinkError as error:
                if not told:
                    message = event("warn", f"{error}; trying again", "web", time.time())
                    self._hub.publish_from_thread(message)
                told = True
                self._closing.wait(RETRY)
                continue
            self._join(session)
            return

    def _join(self, session: Any) -> None:
        from vehicle_link.node import Node

        node = Node(session, f"/{self._vehicle}", "web")
        for topic in STALE:
            # On Zenoh's own thread: it only puts the bytes away.
            node.subscribe(topic, TOPICS[topic].type_name, self._put(topic), direct=True)
        for topic, react in (("events", self._on_event), ("parameter_changes", self._on_change)):
            node.subscribe(topic, TOPICS[topic].type_name, react, qos=TOPICS[topic].qos)
        self._stick = node.advertise(TOPICS["stick"])
        self._node = node

    def _put(self, topic: str) -> Callable[[Received], None]:
        def put(received: Received) -> None:
            self._live.put(topic, received.payload)

        return put

    def _on_event(self, received: Received) -> None:
        log = decode(received.payload, "rcl_interfaces/Log")
        stamp = received.received_ns * 1e-9
        level = LEVELS.get(int(log.level), "info")
        self._hub.publish_from_thread(event(level, log.msg, log.name or self._vehicle, stamp))

    def _on_change(self, received: Received) -> None:
        change = decode(received.payload, "quadlab_msgs/ParameterChange")
        self.on_change(change.name, change.new_value, change.requester, int(change.revision))


def _close(node: Node) -> None:
    node.close()
    node.session.close()  # type: ignore[no-untyped-call]
