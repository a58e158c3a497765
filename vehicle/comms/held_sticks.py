"""Sticks that count: those that were silent while held, or are another sender's, must be seen
released or centred first.
"""

from __future__ import annotations

import threading

from vehicle_link.clock import monotonic_ns
from vehicle_link.topics.control_inputs import Sticks

SILENT_NS = 500_000_000
"""Silence after which held sticks no longer count; they stop the vehicle earlier, by
behavior.joy_timeout."""
CENTRED = 0.15
"""Deflection below which a stick counts as centred, as for a ground station's."""
AGAIN = "they count again once they are released or centred"


class HeldSticks:
    """The sticks received last, of whichever sender; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._sender = b""
        self._received_ns = 0
        self._is_held = self._must_rest = False

    def count(self, sender: bytes, sticks: Sticks) -> bool:
        """Note sticks that were received, and return whether they count.

        Args:
            sender: the publisher's GID; empty when it is known to be the station's.
        """
        now_ns = monotonic_ns()
        with self._lock:
            self._notice(now_ns)
            if sender and self._sender not in (b"", sender):
                self._must_rest = True
            self._sender, self._received_ns = sender or self._sender, now_ns
            self._is_held = sticks.enabled
            if not sticks.enabled or all(abs(axis) <= CENTRED for axis in sticks.axes):
                self._must_rest = False
            return not self._must_rest

    def fell_silent(self) -> bool:
        """Return whether held sticks have just become silent; once for each silence."""
        with self._lock:
            return self._notice(monotonic_ns())

    def _notice(self, now_ns: int) -> bool:
        is_silent = self._is_held and now_ns - self._received_ns > SILENT_NS
        if is_silent:
            self._is_held, self._must_rest = False, True
        return is_silent
