"""ROS 2 node of another implementation (zenoh-ros2-sdk) in a separate process.

`python ros2_node.py PORT FOLDER`: a router's TCP port on loopback, and message definitions in the
form of ROS 2 packages, so that nothing is downloaded. It answers each line of JSON by a line of
JSON.
"""

from __future__ import annotations

import json
import queue
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from zenoh_ros2_sdk import (
    ROS2Publisher,
    ROS2ServiceClient,
    ROS2Subscriber,
    ZenohSession,
    get_service_names_and_types,
    get_topic_names_and_types,
    message_registry,
)

WAIT = 10.0  # s: a bound


class Peer:
    def __init__(self, port: int, definitions: Path) -> None:
        self._session = ZenohSession.get_instance("127.0.0.1", port)
        message_registry.get_repository_for_package = lambda package: None  # downloads nothing
        message_registry.get_registry(str(definitions))
        self._heard: dict[str, queue.SimpleQueue[Any]] = {}
        self._open: list[Any] = []
        self._publishers: dict[str, Any] = {}

    def graph(self, awaited: str) -> dict[str, Any]:
        """Return the graph as soon as this topic is in it."""
        end = time.monotonic() + WAIT
        while True:
            topics = dict(get_topic_names_and_types(timeout=2.0))
            if awaited in topics or time.monotonic() > end:
                return {
                    "topics": topics,
                    "services": dict(get_service_names_and_types(timeout=2.0)),
                }

    def subscribe(self, topic: str, kind: str) -> bool:
        heard = self._heard[topic] = queue.SimpleQueue()
        self._open.append(ROS2Subscriber(topic, kind, heard.put))
        return True

    def hear(self, topic: str) -> Any:
        return plain(self._heard[topic].get(timeout=WAIT))

    def advertise(self, topic: str, kind: str) -> bool:
        self._publishers[topic] = ROS2Publisher(topic, kind)
        self._open.append(self._publishers[topic])
        return True

    def publish(self, topic: str, fields: dict[str, Any]) -> bool:
        publisher = self._publishers[topic]
        publisher.publish(**{name: self._value(value) for name, value in fields.items()})
        return True

    def _value(self, value: Any) -> Any:
        """Return messages and arrays from dictionaries that name their types."""
        if isinstance(value, list):
            return [self._value(v) for v in value]
        if not isinstance(value, dict):
            return value
        kind = value.pop("of")
        if "/" not in kind:
            return np.array(value["values"], kind)
        made = self._session.store.types[kind]
        return made(**{k: self._value(v) for k, v in value.items()})

    def call(self, service: str, kind: str, fields: dict[str, Any], kind_hash: str | None) -> Any:
        end = time.monotonic() + WAIT
        while service not in dict(get_service_names_and_types(timeout=2.0)):
            assert time.monotonic() < end, f"there is no service {service}"
        client = ROS2ServiceClient(service, kind, timeout=WAIT, type_hash=kind_hash)
        try:
            answer = client.call(**{k: self._value(v) for k, v in fields.items()})
        finally:
            client.close()
        return plain(answer)

    def close(self) -> None:
        for one in self._open:
            one.close()
        self._session.close()


def plain(value: Any) -> Any:
    """Return the message in a form for JSON."""
    if hasattr(value, "__dataclass_fields__"):
        fields = {name: getattr(value, name) for name in value.__dataclass_fields__}
        return {name: plain(v) for name, v in fields.items() if not name.startswith("__")}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return value.item() if isinstance(value, np.generic) else value


def main() -> None:
    peer = Peer(int(sys.argv[1]), Path(sys.argv[2]))
    print(json.dumps("ready"), flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        try:
            answer = {"answer": getattr(peer, request["do"])(*request["with"])}
        except Exception as error:
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), flush=True)
    peer.close()


if __name__ == "__main__":
    main()
