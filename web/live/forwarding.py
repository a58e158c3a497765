"""Forwarding of the hub's messages to the clients that subscribe to them.

Zenoh's thread only queues a message; 50 times a second the event loop gives each client what has
arrived for it. A topic is subscribed to at the hub while any client subscribes to it.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import partial
from typing import Any, Protocol

from quadrotor.errors import LinkError
from quadrotor.parameter_description import ParameterValue
from vehicle_link.transport.publisher import Received

PERIOD = 0.02  # s
MOST_WAITING = 20_000  # messages, while the event loop is blocked

Forward = Callable[[Mapping[str, Callable[[Received], None]]], None]


class ForwardingClient(Protocol):
    """Receiver of topics as they arrive.

    It is a program that speaks Foxglove's protocol, or a page that shows a camera.
    """

    @property
    def topics(self) -> Collection[str]: ...

    def put(self, topic: str, received_ns: int, payload: bytes) -> None:
        """Queue a message, which may be of another client's topic."""

    def wake(self) -> None:
        """Send the queued messages."""

    def changed(self, values: dict[str, ParameterValue]) -> None:
        """Handle new values of parameters."""


class Forwarding:
    """Forwarding of one vehicle's topics.

    Args:
        forward: sets the topics that are subscribed to, with their functions (web.live.station).
    """

    def __init__(self, forward: Forward) -> None:
        self._forward = forward
        self._arrived: deque[tuple[str, Received]] = deque(maxlen=MOST_WAITING)
        self._taken: frozenset[str] = frozenset()
        self._present = asyncio.Event()
        self.clients: set[ForwardingClient] = set()

    @contextlib.contextmanager
    def serving(self, client: ForwardingClient) -> Iterator[None]:
        """Give the client its messages within the block."""
        self.clients.add(client)
        self._present.set()
        try:
            yield
        finally:
            self.clients.discard(client)

    def parameters_changed(
        self, message: Mapping[str, Any], values: Callable[[], dict[str, ParameterValue]]
    ) -> None:
        """Pass on a message on parameters: one that changed, or that all were read."""
        changed = (
            values() if message["type"] == "parameters" else {message["name"]: message["value"]}
        )
        for client in self.clients:
            client.changed(changed)

    async def run(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            await self._present.wait()
            wanted = frozenset().union(*(client.topics for client in self.clients))
            if wanted != self._taken:
                takers = {name: partial(self._put, name) for name in wanted}
                with contextlib.suppress(LinkError):  # the session is closing; tried again
                    await loop.run_in_executor(None, self._forward, takers)
                    self._taken = wanted
            self._hand_out()
            if not self.clients and not self._taken:
                self._present.clear()
            await asyncio.sleep(PERIOD)

    def _put(self, topic: str, received: Received) -> None:
        self._arrived.append((topic, received))

    def _hand_out(self) -> None:
        arrived, clients = self._arrived, tuple(self.clients)
        while arrived:
            topic, received = arrived.popleft()
            for client in clients:
                client.put(topic, received.received_ns, received.payload)
        for client in clients:
            client.wake()
