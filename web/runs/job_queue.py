"""Programs about runs, one at a time, each in a process of its own that tells how far it is."""

from __future__ import annotations

import os
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from quadrotor.checkout import ROOT
from quadrotor.errors import RefusedError

MOST_WAITING = 20
"""Works that may wait for their turn."""
REASON_LENGTH = 300

WorkName = Literal["none", "waiting", "working", "ready", "failed"]


@dataclass(slots=True)
class Work:
    """The state of something that was asked for."""

    name: WorkName = "waiting"
    progress: float = 0.0  # 0 to 1
    reason: str = ""  # of a failure

    @property
    def is_under_way(self) -> bool:
        return self.name in ("waiting", "working")


class _Order(NamedTuple):
    work: Work
    arguments: Sequence[str]
    finish: Callable[[str], str]


class Workshop:
    """Thread-safe. Its thread starts with the first work.

    Args:
        module: the program; it prints its progress, 0 to 1, a line each, and an error as a line
            that does not begin with a digit.
        what: the works' name, in the plural.
        seconds: one may take; 0 for no bound.
    """

    def __init__(self, module: str, what: str, seconds: float = 0.0) -> None:
        self._module, self._what, self._seconds = module, what, seconds
        self._lock = threading.Lock()
        self._orders: queue.Queue[_Order | None] = queue.Queue()
        self._worker: threading.Thread | None = None
        self._process: subprocess.Popen[str] | None = None
        self._is_stopped = False

    @property
    def process(self) -> subprocess.Popen[str] | None:
        """Return the process that is running."""
        return self._process

    def put(
        self, work: Work, arguments: Sequence[str], finish: Callable[[str], str] = lambda why: why
    ) -> None:
        """Queue work behind that which waits; its state is written into `work`.

        Args:
            finish: called in the workshop's thread behind the process, with the reason it failed
                or nothing; gives the reason to tell, or nothing for what is ready.

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
        """End the process that is running, if one is."""
        with self._lock:
            self._is_stopped = True
            if self._process is not None:
                self._process.kill()
        self._orders.put(None)

    def _run(self) -> None:
        while (order := self._orders.get()) is not None and not self._is_stopped:
            work = order.work
            try:
                reason = order.finish(self._work(work, order.arguments))
            except Exception as error:  # the others wait for this thread
                reason = f"cannot be made: {error}"
            if reason:
                work.reason, work.name = reason, "failed"
            else:
                work.progress, work.name = 1.0, "ready"

    def _work(self, work: Work, arguments: Sequence[str]) -> str:
        """Do the work and return why it failed; "" when it did not."""
        path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]).strip(os.pathsep)
        work.name = "working"
        with self._lock:
            if self._is_stopped:
                return "stopped before its turn"
            self._process = process = subprocess.Popen(
                [sys.executable, "-m", self._module, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                env={**os.environ, "PYTHONPATH": path},
            )
        late = threading.Timer(self._seconds, process.kill)
        if self._seconds:
            late.start()
        said = ""
        assert process.stdout is not None
        for line in process.stdout:
            try:
                work.progress = float(line)
            except ValueError:
                said = line.strip() or said
        status = process.wait()
        is_late = bool(self._seconds) and not late.is_alive()
        late.cancel()
        with self._lock:
            self._process = None
        if status == 0:
            return ""
        slow = f"not done after {self._seconds:.0f} s"
        return slow if is_late else said[:REASON_LENGTH] or f"its process ended with {status}"
