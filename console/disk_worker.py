"""A worker thread for tasks that wait for the disk, so that another thread need not."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable

log = logging.getLogger(__name__)

Task = Callable[[], None]


class DiskWorker:
    """Runs tasks in order; an exception of one is logged and ignored.

    Args:
        done: called in the worker's thread after each.
    """

    def __init__(self, name: str, done: Task = lambda: None) -> None:
        self._done = done
        self._queue: queue.SimpleQueue[Task | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._open = 0
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def is_idle(self) -> bool:
        return self._open == 0

    def put(self, task: Task) -> None:
        """Queue a task, from any thread; never waits."""
        with self._lock:
            self._open += 1
        self._queue.put(task)

    def close(self, timeout: float) -> None:
        """Finish all queued tasks, within `timeout` s, and end."""
        self._queue.put(None)
        self._thread.join(timeout)

    def _run(self) -> None:
        while (task := self._queue.get()) is not None:
            try:
                task()
            except Exception:
                log.exception("disk task")
            with self._lock:
                self._open -= 1
            self._done()
