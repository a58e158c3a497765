"""Queues of calls, each handled in order, on threads that many queues share.

A thread for each service would be idle nearly all the time; with a single shared thread a slow
service would hold up all others.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor
from typing import Generic, TypeVar

from vehicle_link import defects

T = TypeVar("T")


class ExecutorQueue(Generic[T]):
    """Queue that handles items in the order of their arrival, a limited number at a time.

    Args:
        executor: lends threads while items wait.
        handle: called with each item; an error in it is a defect of the process.
        at_once: number of items handled at the same time.
        newest: number of the newest items that may wait, older ones are dropped; 0: all.
    """

    def __init__(
        self, executor: Executor, handle: Callable[[T], None], at_once: int = 1, newest: int = 0
    ) -> None:
        self._executor, self._handle, self._at_once = executor, handle, at_once
        self._lock = threading.Lock()
        self._waiting: deque[T] = deque(maxlen=newest or None)
        self._threads = 0

    def put(self, item: T) -> None:
        """Add an item; thread-safe.

        Raises:
            RuntimeError: the executor is shut down; the item is not kept.
        """
        with self._lock:
            if self._threads < self._at_once:
                self._executor.submit(self._run)  # waits for the lock first
                self._threads += 1
            self._waiting.append(item)

    def _run(self) -> None:
        while True:
            with self._lock:
                if not self._waiting:
                    self._threads -= 1
                    return
                item = self._waiting.popleft()
            try:
                self._handle(item)
            except BaseException as error:  # a pool would keep it, and this queue would stand still
                defects.report(error)
