"""Hashing of passwords outside the event loop, two at a time, with a short queue."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import ParamSpec, TypeVar

from quadrotor.errors import QuadlabError

AT_ONCE = 2
WAITING = 16  # including those being hashed; each takes about 0.1 s and 64 MiB

P = ParamSpec("P")
T = TypeVar("T")


class BusyError(QuadlabError):
    """Too many passwords are being checked at once."""


class Hashing:
    def __init__(self) -> None:
        self._executor = ThreadPoolExecutor(AT_ONCE, thread_name_prefix="hashing")
        self._under_way = 0

    async def run(self, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Run a function in the hashing threads. Raises BusyError if the queue is full."""
        if self._under_way >= WAITING:
            raise BusyError("too many people sign in at once; try again in a few seconds")
        self._under_way += 1
        loop = asyncio.get_running_loop()
        try:
            return await loop.run_in_executor(self._executor, lambda: function(*args, **kwargs))
        finally:
            self._under_way -= 1

    def stop(self) -> None:
        self._executor.shutdown(wait=False, cancel_futures=True)
