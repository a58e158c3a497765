"""The vehicle's publishers on the link, one per topic.

Best-effort topics are published at once (1 ms at most). Reliable ones may have to wait for a
congested link, so they go through a queue and a separate thread.
"""

from __future__ import annotations

import queue
import threading

from vehicle_link.topics import TOPICS
from vehicle_link.transport.node import Node

WAITING_MAX = 1000


class LinkRadio:
    """Publishers of every topic of the table that the vehicle sends."""

    def __init__(self, node: Node) -> None:
        self.lost = 0  # number of reliable messages lost, as the link was stalled
        rows = [topic for topic in TOPICS.values() if topic.sender == "vehicle"]
        self.publishers = {row.name: node.advertise(row) for row in rows}
        """Publishers by topic."""
        self._patient = {row.name for row in rows if not row.drop}
        self._queue: queue.Queue[tuple[str, bytes, int] | None] = queue.Queue(WAITING_MAX)
        self._thread = threading.Thread(target=self._run, name="reliable", daemon=True)
        self._thread.start()

    def put(self, topic: str, payload: bytes, source_ns: int) -> None:
        """Send now, or as soon as the link has capacity."""
        if topic not in self._patient:
            self.publishers[topic].put(payload, source_ns)
            return
        try:
            self._queue.put_nowait((topic, payload, source_ns))
        except queue.Full:
            self.lost += 1

    def close(self, timeout_s: float = 0.5) -> None:
        """Send the queued messages, as far as the time allows."""
        try:
            self._queue.put_nowait(None)
        except queue.Full:
            return
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while (item := self._queue.get()) is not None:
            topic, payload, source_ns = item
            self.publishers[topic].put(payload, source_ns)
