"""A filter of samples that Zenoh delivers to the subscription of another topic.

Zenoh sends numbers instead of keys. When links open and close under load, a sample of the
best-effort channel may arrive after its number has been given another meaning: seen once, when an
odometry arrived as a parameter change. Every publisher has one topic, so its GID reveals this.
"""

from __future__ import annotations

import threading

ESTABLISHED = 10
"""Number of samples after which a publisher's topic is known."""
FORGIVEN = 3
"""Number of consecutive samples on another topic that are refused; after that the topic counts as
the publisher's."""
KNOWN = 1000
"""Number of publishers remembered, over all nodes of this process; the oldest is forgotten
first."""


class PublisherTopics:
    """The topics of each publisher, learnt from its samples. Thread-safe.

    Attributes:
        refused: number of samples refused so far.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: dict[bytes, tuple[str, int, int]] = {}  # GID → key, samples, strange ones
        self.refused = 0

    def belongs(self, gid: bytes, key: str) -> bool:
        """Return whether a sample under this key may be from this publisher."""
        # Usually without the lock: otherwise threads of all subscriptions would queue up behind the
        # one that holds it while it waits for the interpreter.
        known = self._known.get(gid, (key, 0, 0))
        if known == (key, ESTABLISHED, 0):
            return True
        with self._lock:
            of, count, strange = self._known.get(gid, known)
            if of != key and (count < ESTABLISHED or strange >= FORGIVEN):
                of, count, strange = key, 0, 0
            is_right = of == key
            count = min(count + 1, ESTABLISHED)
            self._known[gid] = (of, count, 0 if is_right else strange + 1)
            if len(self._known) > KNOWN:
                self._known.pop(next(iter(self._known)))
            self.refused += not is_right
            return is_right
