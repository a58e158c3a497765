"""Samples that Zenoh hands to the subscription of another topic.

Zenoh sends numbers for keys. When links come and go under load, a sample of the best-effort channel
may arrive after its number has got another meaning: seen once, an odometry that came as a parameter
change. Every publisher has one topic, so its GID tells.
"""

from __future__ import annotations

import threading

ESTABLISHED = 10
"""Samples after which a publisher's topic is known."""
FORGIVEN = 3
"""Samples in a row on another topic that are refused; who goes on means it."""
KNOWN = 1000
"""Publishers remembered, of all nodes of this process; the first known is forgotten first."""


class Topics:
    """The topics of each publisher, learnt from what comes. Thread-safe.

    Attributes:
        refused: samples so far.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: dict[bytes, tuple[str, int, int]] = {}  # GID → key, samples, strange ones
        self.refused = 0

    def belongs(self, gid: bytes, key: str) -> bool:
        """Return whether a sample of this publisher may have come under this key."""
        # Without the lock, as nearly always: threads of all subscriptions would queue up behind
        # whoever holds it and waits for the interpreter.
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
