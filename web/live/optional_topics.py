"""Topics that are received only while a page or client shows them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from vehicle_link.topics.table import TOPICS

if TYPE_CHECKING:
    from vehicle_link.transport.loopback import Session
    from vehicle_link.transport.node import Node
    from vehicle_link.transport.publisher import Received

    Put = Callable[[Received], None]


class OptionalTopics:
    """Subscriptions to a set of topics that may change at any time; thread-safe.

    Each topic has a node, because a node closes as a whole.

    Args:
        prefix: prefix of the nodes' names.
        complete: whether kept topics are received without gaps.

    Attributes:
        wanted: the topics to subscribe to, each with its function.
    """

    def __init__(self, vehicle: str, prefix: str, complete: bool = False) -> None:
        self._vehicle, self._prefix, self._complete = vehicle, prefix, complete
        self.wanted: Mapping[str, Put] = {}
        self._nodes: dict[str, Node] = {}
        self._session: Session | None = None
        self._lock = threading.Lock()

    def want(self, topics: Mapping[str, Put]) -> None:
        """Subscribe to these topics and no others.

        Each message is passed to its function on Zenoh's thread. Blocks for some ms.
        """
        with self._lock:
            self.wanted = dict(topics)
            self._renew()

    def join(self, session: Session) -> None:
        """Subscribe in this session from now on."""
        with self._lock:
            self._session = session
            self._renew()

    def close(self) -> None:
        """End all subscriptions."""
        with self._lock:
            for node in self._nodes.values():
                node.close()

    def _renew(self) -> None:
        from vehicle_link.transport.node import Node

        if self._session is None:
            return
        for topic in self._nodes.keys() - self.wanted.keys():
            self._nodes.pop(topic).close()
        for topic in self.wanted.keys() - self._nodes.keys():
            name = f"{self._prefix}{topic.strip('/')}"
            self._nodes[topic] = Node(self._session, f"/{self._vehicle}", name)
            subscribe_directly(self._nodes[topic], topic, self.wanted[topic], self._complete)


def subscribe_directly(node: Node, topic: str, put: Put, complete: bool = False) -> None:
    """Subscribe on Zenoh's own thread, which `put` must not hold up."""
    row = TOPICS[topic]
    node.subscribe(topic, row.type_name, put, qos=row.qos, direct=True, complete=complete)
