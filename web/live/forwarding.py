"""Messages of the hub to the clients that subscribe them, as they come.

Zenoh's thread only puts a message away; 50 times a second the event loop gives each client what
came for it. A topic is subscribed at the hub while some client subscribes it.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import partial
from typing import Any, Protocol

from quadrotor.errors import LinkError
from quadrotor.parameters import ParameterValue
from vehicle_link.transport.publisher import Received

PERIOD = 0.02  # s
MOST_WAITING = 20_000  # messages, while the event loop stands still

Forward = Callable[[Mapping[str, Callable[[Received], None]]], None]


class ForwardingClient(Protocol):
    """One that takes topics as they come: a program that speaks Foxglove's protocol, or a page that
    looks at a camera.
    """

    @property
    def topics(self) -> Collection[str]: ...

    def put(self, topic: str, received_ns: int, payload: bytes) -> None:
        """Take a message of any client's topic."""

    def wake(self) -> None:
        """Send what was put."""

    def changed(self, values: dict[str, ParameterValue]) -> None:
        """Take new values of parameters."""


class Forwarding:
    """The forwarding of one vehicle. Args: `forward` (web.live.station) says what is taken."""

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

    def told(
        self, message: Mapping[str, Any], values: Callable[[], dict[str, ParameterValue]]
    ) -> None:
        """Pass on what pages are told of parameters: one that changed, or that all were read."""
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
                with contextlib.suppress(LinkError):  # the session goes; asked again
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
