"""Messages that may come by two ways, let through in the order they were published in.

An order must not be undone by an older one that the slower way brings later.
"""

from __future__ import annotations

import threading
from collections import OrderedDict

from vehicle_link.transport.publisher import Received

KEPT = 16
"""Publishers of a topic remembered, those heard last."""


class NewestOnly:
    """Thread-safe. Publishers are told apart by their GIDs."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._newest: dict[str, OrderedDict[bytes, int]] = {}
        self.late = 0

    def is_newer(self, topic: str, received: Received) -> bool:
        """Return whether no sample as new came from its publisher; counted in `late` when one
        did.
        """
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
