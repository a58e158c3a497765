"""Jobs on runs, one at a time, each in a separate process that reports its progress."""

from __future__ import annotations

import math
import queue
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

from flight_log.file import is_being_written
from quadrotor.errors import QuadlabError, RefusedError, os_errors
from vehicle_link.jobs import run

MOST_WAITING = 20
"""Largest number of works that wait for their turn."""
REASON_LENGTH = 300

WorkName = Literal["none", "waiting", "working", "ready", "failed"]


@dataclass(slots=True)
class Work:
    """State of a requested work."""

    name: WorkName = "waiting"
    progress: float = 0.0  # 0 to 1
    reason: str = ""  # of a failure
    result: Any = None  # what the job returned

    @property
    def is_under_way(self) -> bool:
        return self.name in ("waiting", "working")


class _Order(NamedTuple):
    work: Work
    arguments: Sequence[Any]
    finish: Callable[[str], str]


def check_closed(run_id: str, log: Path, what: str) -> None:
    """Raise RefusedError while the run is being recorded, StorageError if it cannot be read."""
    with os_errors(lambda why: f"cannot read {log}: {why}"):
        if is_being_written(log):
            raise RefusedError(
                f"run {run_id} is being recorded; its {what} can be made once it has ended"
            )


class Workshop:
    """Queue of works, and the thread that runs them; thread-safe.

    The thread starts with the first work.

    Args:
        function: the job (vehicle_link.jobs); reports its progress, 0 to 1.
        what: name of the works, in the plural.
        seconds: longest time of one.
    """

    def __init__(self, function: Callable[..., Any], what: str, seconds: float = math.inf) -> None:
        self._function, self._what, self._seconds = function, what, seconds
        self._lock = threading.Lock()
        self._orders: queue.Queue[_Order | None] = queue.Queue()
        self._worker: threading.Thread | None = None
        self._is_stopped = False

    def put(
        self, work: Work, arguments: Sequence[Any], finish: Callable[[str], str] = lambda why: why
    ) -> None:
        """Queue a work; its state is written into `work`.

        Args:
            finish: called in the queue's thread after the process has ended, with the reason of its
                failure or ""; returns the reason to report, or "" for success.

        Raises RefusedError while too many wait.
        """
        with self._lock:
            if self._orders.qsize() >= MOST_WAITING:
                raise RefusedError(
                    f"{MOST_WAITING} {self._what} wait already; try again in some minutes"
                )
            work.name = "waiting"
            self._orders.put(_Order(work, arguments, finish))
            if self._worker is None and not self._is_stopped:
                self._worker = threading.Thread(target=self._run, name=self._what, daemon=True)
                self._worker.start()

    def stop(self) -> None:
        """End the running process, if any."""
        self._is_stopped = True
        self._orders.put(None)

    def _run(self) -> None:
        while (order := self._orders.get()) is not None and not self._is_stopped:
            work = order.work
            try:
                reason = order.finish(self._work(work, order.arguments))
            except Exception as error:  # other works wait for this thread
                reason = f"cannot be made: {error}"
            if reason:
                work.reason, work.name = reason, "failed"
            else:
                work.progress, work.name = 1.0, "ready"

    def _work(self, work: Work, arguments: Sequence[Any]) -> str:
        """Do the work; return why it failed, or "" if it succeeded."""
        work.name = "working"

        def check() -> None:
            if self._is_stopped:
                raise RefusedError("stopped")

        def report(share: float) -> None:
            work.progress = share

        try:
            work.result = run(
                self._function, *arguments, seconds=self._seconds, check=check, report=report
            )
        except QuadlabError as error:
            return str(error)[:REASON_LENGTH]
        return ""
