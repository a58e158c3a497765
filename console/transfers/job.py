"""A transfer of the station and its state."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field
from typing import Any, Literal

from quadrotor.errors import QuadlabError
from vehicle_link.messages import new

Kind = Literal["download", "backfill"]
Phase = Literal[
    "waiting", "fetching", "checking", "merging", "done", "incomplete", "failed", "cancelled"
]
ENDED = ("done", "incomplete", "failed", "cancelled")


class CancelledError(QuadlabError):
    """The job was cancelled on request."""


class NotYetError(QuadlabError):
    """The job lacks something for the moment, with the reason; it is tried again."""


@dataclass
class Job:
    """One thread works on it, others look and cancel.

    Attributes:
        id: tells it from an earlier one of the same name.
        name: of the file on board, or of the run.
        asked: by a person, who gets what is missing told again.
        rate: bytes/s.
        tries: so often it came to nothing yet.
        ended: s, monotonic, when it came to its end.
    """

    id: int
    kind: Kind
    name: str
    asked: bool = False
    phase: Phase = "waiting"
    bytes: int = 0
    total_bytes: int = 0
    rate: float = 0.0
    problem: str = ""
    tries: int = 0
    ended: float = 0.0
    cancelled: threading.Event = field(default_factory=threading.Event)

    def end(self, phase: Phase, problem: str = "") -> None:
        self.problem, self.rate, self.ended = problem, 0.0, time.monotonic()
        self.phase = phase

    def check(self) -> None:
        """Raise CancelledError when it is no longer needed."""
        if self.cancelled.is_set():
            raise CancelledError("cancelled")

    @property
    def is_over(self) -> bool:
        return self.phase in ENDED

    def message(self) -> Any:
        """Return quadlab_msgs/Transfer."""
        names = ("id", "kind", "name", "phase", "bytes", "total_bytes", "rate", "problem")
        return new("quadlab_msgs/Transfer", **{name: getattr(self, name) for name in names})
