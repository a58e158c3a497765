"""A record of what was received already: a window of counters (RFC 4303, section 3.4.3), for the
datagrams of a lane, and the newest message of each publisher, for topics that may arrive over two
paths.
"""

from __future__ import annotations

import threading
from collections import OrderedDict

from vehicle_link.transport.publisher import Received

SIZE = 1024
"""Number of counters remembered: 5 s of one lane. Older ones count as received."""
_ALL = (1 << SIZE) - 1


class ReplayWindow:
    """A window that refuses repeated counters; for one thread at a time. Counters begin at 1."""

    def __init__(self) -> None:
        self.newest = 0
        self._received = 0  # bit k: newest - k

    def is_new(self, counter: int) -> bool:
        if counter > self.newest:
            return True
        behind = self.newest - counter
        return counter > 0 and behind < SIZE and not self._received >> behind & 1

    def mark_received(self, counter: int) -> None:
        """Mark a counter as received."""
        if counter > self.newest:
            # A jump of 2⁶³ must not shift by as much.
            ahead = min(counter - self.newest, SIZE)
            self._received = (self._received << ahead | 1) & _ALL
            self.newest = counter
        else:
            self._received |= 1 << (self.newest - counter)


KEPT = 16
"""Number of publishers remembered for each topic, the most recent ones."""


class NewestOnly:
    """Filter of messages by publisher (GID) and sequence number. Thread-safe.

    A command must not be undone by an older one that the slower path delivers later.
    """

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
