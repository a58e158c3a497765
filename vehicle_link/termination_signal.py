"""A flag that is set when a signal asks this process to end."""

from __future__ import annotations

import select
import signal
import socket
from collections.abc import Iterable
from contextlib import suppress
from typing import Protocol

ENDING = signal.SIGTERM, signal.SIGINT, signal.SIGHUP  # the last one: the terminal was closed


class Ending(Protocol):
    """An event that a loop waits on; a threading.Event when no signal sets it."""

    def wait(self, timeout: float) -> bool: ...


class EndSignal:
    """A flag set by signals from its construction on, which must be in the main thread.

    A handler must not set a threading.Event: handlers run in the main thread, between any two of
    its steps. If that thread happened to hold the event's lock, which is not re-entrant, it would
    wait for itself for ever.

    Attributes:
        count: number of signals received; a second one asks for more haste.
    """

    def __init__(self, numbers: Iterable[int] = ENDING) -> None:
        self.count = 0
        self._reader, self._writer = socket.socketpair()
        self._writer.setblocking(False)
        for number in numbers:
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # nohup
                signal.signal(number, self._note)

    def wait(self, timeout: float) -> bool:
        """Wait for a signal for at most `timeout` seconds; return whether one was received."""
        if not self.count:
            select.select([self._reader], [], [], timeout)
        return bool(self.count)

    def _note(self, number: int, frame: object) -> None:
        self.count += 1
        with suppress(BlockingIOError):  # the buffer is full: the waiting thread has been woken
            self._writer.send(b"\0")
