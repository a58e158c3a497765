"""Requests by the user at the terminal to stop, by Ctrl-C or SIGTERM."""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Iterator
from types import FrameType


class StopRequest:
    """Counter of Ctrl-C and SIGTERM: the first asks to stop, the second to stop at once."""

    def __init__(self) -> None:
        self.count = 0

    @contextlib.contextmanager
    def installed(self) -> Iterator[None]:
        """Count the signals within; restore the previous handlers afterwards."""
        numbers = (signal.SIGINT, signal.SIGTERM)
        previous = {number: signal.signal(number, self._on_signal) for number in numbers}
        try:
            yield
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)

    def wait(self, seconds: float) -> bool:
        """Sleep at most `seconds`; return whether a stop was requested."""
        end = time.monotonic() + seconds
        while not self.count and (left := end - time.monotonic()) > 0:
            time.sleep(min(left, 0.1))
        return bool(self.count)

    @property
    def at_once(self) -> bool:
        return self.count > 1

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self.count += 1
