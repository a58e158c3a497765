"""A filter for messages that may arrive over two paths: it drops those that are out of order.

A command must not be undone by an older one that the slower path delivers later.
"""

from __future__ import annotations

import threading
from collections import OrderedDict

from vehicle_link.transport.publisher import Received

KEPT = 16
"""Number of publishers remembered for each topic, the most recent ones."""


class NewestOnly:
    """Filter of messages by publisher (GID) and sequence number. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._newest: dict[str, OrderedDict[bytes, int]] = {}
        self.late = 0

    def is_newer(self, topic: str, received: Received) -> bool:
        """Return whether the message is the publisher's newest; count it in `late` if not."""
        with self._lock:
            newest = self._newest.setdefault(topic, OrderedDict())
            if received.sequence <= newest.get(received.gid, 0):
                self.late += 1
                return False
            newest[received.gid] = received.sequence
            newest.move_to_end(received.gid)
            if len(newest) > KEPT:
                newest.popitem(last=False)
            return True
