"""Items of several sources, handed on in the order of the times at which they were taken."""

from __future__ import annotations

import heapq
from collections import deque
from itertools import count
from typing import Generic, TypeVar

T = TypeVar("T")

LONGEST_NS = 30_000_000
"""Longest time in ns for which an item waits for older ones of other sources."""
SILENT_NS = 200_000_000
"""Time in ns without items after which nobody waits for a source."""
RECENT = 30
"""Number of items from which a source's usual delay is known."""


class InOrder(Generic[T]):
    """Holds items back until no older one of another source is to be expected.

    An item that is older than one already handed on is dropped.

    Args:
        sources: how many there are.
    """

    def __init__(self, sources: int) -> None:
        self._waiting: list[tuple[int, int, T]] = []
        self._count = count()
        self._newest: list[int | None] = [None] * sources
        self._arrived_ns = [0] * sources
        self._ages: list[deque[int]] = [deque(maxlen=RECENT) for _ in range(sources)]
        self._done_ns: int | None = None

    def put(self, source: int, taken_ns: int, item: T, now_ns: int) -> None:
        """Add an item that was taken at `taken_ns`; both times are of one steady clock."""
        self._newest[source], self._arrived_ns[source] = taken_ns, now_ns
        self._ages[source].append(now_ns - taken_ns)
        if self._done_ns is None or taken_ns >= self._done_ns:
            heapq.heappush(self._waiting, (taken_ns, next(self._count), item))

    def due(self, now_ns: int) -> list[T]:
        """Return the items that wait no longer, oldest first."""
        found = []
        while (next_ns := self.due_ns(now_ns)) is not None and next_ns <= now_ns:
            self._done_ns, _, item = heapq.heappop(self._waiting)
            found.append(item)
        return found

    def due_ns(self, now_ns: int) -> int | None:
        """Return until when the oldest item waits at most; None without one."""
        if not self._waiting:
            return None
        taken_ns = self._waiting[0][0]
        waits = [
            min(LONGEST_NS, max(ages))
            for ages, newest, arrived_ns in zip(
                self._ages, self._newest, self._arrived_ns, strict=True
            )
            if newest is not None and newest < taken_ns and now_ns - arrived_ns < SILENT_NS
        ]
        return taken_ns + max(waits, default=0)
