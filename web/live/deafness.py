"""The end of a web process that hears nothing from a station that is there.

Zenoh receives in threads of its own. If these end (without memory, for instance), the page is still
served, and shows and commands nothing. `quadlab up` starts a process that ended again.
"""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable, Iterable

from web.latest import Live

DEAF_AFTER = 5.0
"""Time, in s, without the station's regular message `link_status`."""
CHECKS, PERIOD = 3, 1.0
"""Number of checks in a row, and their period in s, that must find the station there meanwhile:
one that has just been started is not heard at once."""
ASKING = 0.5
"""Time limit, in s, for the station's router to accept a connection."""


class Deafness:
    """Watch over the messages that this process should hear.

    Args:
        lives: the newest messages of each vehicle.
        port: of the station's router, on this computer.
        end: ends the process.
    """

    def __init__(self, lives: Iterable[Live], port: int, end: Callable[[], None]) -> None:
        self._lives, self._port, self._end = list(lives), port, end
        self._found = 0

    def run(self) -> None:
        """Check until the process is to end; blocks."""
        while not self.is_deaf():
            time.sleep(PERIOD)
        self._end()

    def is_deaf(self) -> bool:
        """Return whether this process heard the station before, and no longer hears it."""
        age = min(live.age("link_status") for live in self._lives)
        if math.isinf(age) or age <= DEAF_AFTER or not self._accepts():
            self._found = 0
            return False
        self._found += 1
        return self._found >= CHECKS

    def _accepts(self) -> bool:
        """Return whether the station's router accepts a connection."""
        try:
            socket.create_connection(("127.0.0.1", self._port), ASKING).close()
        except OSError:
            return False
        return True
