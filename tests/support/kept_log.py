"""Flight log in memory for tests, in place of a file."""

from __future__ import annotations

from collections.abc import Callable

from vehicle import mailbox
from vehicle_link.parameters.change import ParameterChange


class KeptLog:
    """Log that stores events and parameter changes, and drops every other message."""

    def __init__(self) -> None:
        self.events: list[mailbox.Event] = []
        self.changes: list[ParameterChange] = []

    @property
    def texts(self) -> list[str]:
        """Return the text of each event."""
        return [event.text for event in self.events]

    def event(self, event: mailbox.Event) -> None:
        self.events.append(event)

    def parameter_change(self, change: ParameterChange) -> None:
        self.changes.append(change)

    def __getattr__(self, _: str) -> Callable[..., None]:
        return lambda *_: None
