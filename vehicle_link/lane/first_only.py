"""A message that may come by two ways, let through once."""

from __future__ import annotations

import threading
from collections import deque

from vehicle_link.transport.node import Received

KEPT = 512
"""Messages of a topic looked back on: 5 s of the fastest."""

Mark = tuple[bytes, int]


class FirstOnly:
    """Thread-safe. The publisher's GID and sequence mark a message, the same on both ways."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: dict[str, tuple[set[Mark], deque[Mark]]] = {}
        self.again = 0

    def is_first(self, topic: str, received: Received) -> bool:
        """Return whether this sample did not come before; counted in `again` when it did."""
        mark = (received.gid, received.sequence)
        with self._lock:
            known, order = self._known.setdefault(topic, (set(), deque()))
            if mark in known:
                self.again += 1
                return False
            known.add(mark)
            order.append(mark)
            if len(order) > KEPT:
                known.discard(order.popleft())
            return True
