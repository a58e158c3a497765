"""The messages of the flight stack for other processes."""

from __future__ import annotations

from vehicle.flight.tick_record import TickRecord
from vehicle.processes import mailbox


class Outbox:
    """Messages of one flight stack, collected by its caller between two ticks.

    Attributes:
        messages: oldest first; the caller empties the list.
    """

    def __init__(self, tick: TickRecord) -> None:
        self._tick = tick
        self.messages: list[mailbox.Told] = []

    def add(self, message: mailbox.Told) -> None:
        """Add a message."""
        self.messages.append(message)

    def say(self, text: str, level: int = mailbox.INFO) -> None:
        """Add a line for the log and the page, with the time of the newest tick."""
        self.add(mailbox.Event(stamp_ns=self._tick.stamp_ns, level=level, text=text))
