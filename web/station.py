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
from vehicle_link.topics.table import SERVICES
from web.events import LEVELS, EventHub, event
from web.live import TOPICS, Live

if TYPE_CHECKING:
    from vehicle_link.node import Node, Received

CALL_TIMEOUT = 1.5  # s; the station gives the vehicle 1 s
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
        self._stick: Any = None
        self._closing = threading.Event()
        self._callers = ThreadPoolExecutor(16, thread_name_prefix="web-call")
        self._urgent = ThreadPoolExecutor(4, thread_name_prefix="web-emergency")
        self._opener = threading.Thread(target=self._open, name="web-session", daemon=True)

    def start(self) -> None:
        self._opener.start()

    def stop(self) -> None:
        self._closing.set()
        self._opener.join(timeout=2.0)
        if self._node is not None:
            self._node.close()
        self._callers.shutdown(wait=False, cancel_futures=True)
        self._urgent.shutdown(wait=False, cancel_futures=True)

    async def command(self, service: str, requester: str, **fields: Any) -> Reply:
        """Calls one of the station's services. Raises RefusedError with the reason, LinkError."""
        response = await self._call(service, requester, **fields)
        return Reply(run_id=str(getattr(response, "run_id", "")))

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

        client = ParameterClient(self._require_node(), remote)
        return list(client.describe()), dict(client.values())

    def publish_stick(self, axes: tuple[float, float, float, float], enabled: bool) -> None:
        """Forward, left, up, yaw in -1..1; the station stamps, watches and forwards them."""
        if self._stick is not None:
            now = time.time_ns()
            message = new(
                "sensor_msgs/Joy", header=header(now), axes=axes, buttons=[int(enabled)]
            )
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
        client = self._require_node().client(f"station/{service}", SERVICES[service])
        return client.call(request, timeout=CALL_TIMEOUT)

    def _require_node(self) -> Node:
        if self._node is None:
            raise LinkError("the station cannot be reached; is `quadlab station` running?")
        return self._node

    def _open(self) -> None:
        """Until it works: the session, the node, its subscriptions."""
        from vehicle_link.node import Node

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
            node = Node(session, f"/{self._vehicle}", "web")
            for topic, type_name in TOPICS.items():
                node.subscribe(topic, type_name, self._put(topic))
            node.subscribe("events", "rcl_interfaces/Log", self._on_event)
            node.subscribe("parameter_changes", "quadlab_msgs/ParameterChange", self._on_parameter)
            self._stick = node.publisher("stick", "sensor_msgs/Joy")
            self._node = node
            return

    def _put(self, topic: str) -> Callable[[Received], None]:
        def put(received: Received) -> None:
            self._live.put(topic, received.payload)

        return put

    def _on_event(self, received: Received) -> None:
        log = decode(received.payload, "rcl_interfaces/Log")
        stamp = received.received_ns * 1e-9
        level = LEVELS.get(int(log.level), "info")
        self._hub.publish_from_thread(event(level, log.msg, log.name or self._vehicle, stamp))

    def _on_parameter(self, received: Received) -> None:
        change = decode(received.payload, "quadlab_msgs/ParameterChange")
        self.on_change(change.name, change.new_value, change.requester, int(change.revision))


