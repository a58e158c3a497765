"""The window of counters already received (RFC 4303, section 3.4.3): a bitmap behind the newest.

It serves the datagrams of a lane, and messages of a publisher that may arrive over two paths.
"""

from __future__ import annotations

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
