"""A transfer of the station and its state."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field
from typing import Literal

from quadrotor.errors import QuadlabError
from vehicle_link.messages import new
from vehicle_link.messages.records import Transfer

Kind = Literal["download", "backfill"]
KINDS: dict[str, Kind] = {"download": "download", "backfill": "backfill"}
Phase = Literal[
    "waiting", "fetching", "checking", "merging", "done", "incomplete", "failed", "cancelled"
]
ENDED = ("done", "incomplete", "failed", "cancelled")


class CancelledError(QuadlabError):
    """The job was cancelled on request."""


class NotYetError(QuadlabError):
    """A temporary obstacle, with the reason; the job is retried."""


@dataclass
class Job:
    """One transfer; one thread works on it, others read and cancel it.

    Attributes:
        id: distinguishes it from an earlier one of the same name.
        name: of the file on board, or of the run.
        asked: whether a person requested it, and so gets its result reported in any case.
        rate: bytes/s.
        tries: number of unsuccessful tries.
        crashes: number of its processes that were killed.
        ended: s, monotonic, when it ended.
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
    crashes: int = 0
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

    def message(self) -> Transfer:
        """Return the quadlab_msgs/Transfer."""
        names = ("id", "kind", "name", "phase", "bytes", "total_bytes", "rate", "problem")
        return new("quadlab_msgs/Transfer", **{name: getattr(self, name) for name in names})
