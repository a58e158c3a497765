"""A worker thread for tasks that wait for the disk, so that another thread need not."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable

log = logging.getLogger(__name__)

Chore = Callable[[], None]


class DiskChores:
    """Runs chores in order; an exception of one is logged and ignored.

    Args:
        done: called in the chores' thread after each.
    """

    def __init__(self, name: str, done: Chore = lambda: None) -> None:
        self._done = done
        self._queue: queue.SimpleQueue[Chore | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._open = 0
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def is_idle(self) -> bool:
        return self._open == 0

    def put(self, chore: Chore) -> None:
        """Queue a chore, from any thread; never waits."""
        with self._lock:
            self._open += 1
        self._queue.put(chore)

    def close(self, timeout: float) -> None:
        """Finish all queued chores, within `timeout` s, and end."""
        self._queue.put(None)
        self._thread.join(timeout)

    def _run(self) -> None:
        while (chore := self._queue.get()) is not None:
            try:
                chore()
            except Exception:
                log.exception("chore of the disk")
            with self._lock:
                self._open -= 1
            self._done()
