"""Previews of trajectories, computed in a helper process that stays while it is used.

A first preview takes seconds, because its process imports what the vehicle flies with; the next
ones take milliseconds, so that a path can be judged while it is dragged.
"""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from typing import Any

import msgspec

from control.behaviors.demands import Preview
from quadrotor import errors
from quadrotor.checkout import PREFIX
from vehicle_link.jobs import POLL, Job

TIME_LIMIT = 20.0  # s
NICENESS = 0  # added to that of this process: a person waits for the answer


class Previewer:
    """Client of the helper process. A process ends with the thread that started it, so it has one
    thread of its own.
    """

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="preview")
        self._job: Job[None] | None = None
        self._orders = -1
        self._answer: Any = None

    async def preview(self, *given: object) -> Preview:
        """Return `control.behaviors.preview.preview(*given)`. Raises also JobError."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._thread, self.compute, *given)

    def compute(self, *given: Any) -> Preview:
        """Return the preview; only for the thread of this client."""
        self._answer = None
        end = time.monotonic() + TIME_LIMIT
        order = msgspec.json.encode(given) + b"\n"
        if self._job is None or not self._send(order):
            self.close()
            self._start()
            self._send(order)
        while self._answer is None:
            assert self._job is not None
            if self._job.poll(POLL) and self._answer is None:
                job, self._job = self._job, None
                job.result()
                raise errors.JobError("the helper process for previews ended; try again")
            if time.monotonic() >= end and self._answer is None:
                self.close()
                raise errors.JobTimeoutError(f"not done after {TIME_LIMIT:.0f} s")
        if "error" in self._answer:
            kind, text = self._answer["error"]
            raise getattr(errors, kind)(text)
        return msgspec.convert(self._answer["preview"], Preview)

    def stop(self) -> None:
        self._thread.submit(self.close)
        self._thread.shutdown()

    def close(self) -> None:
        """End the helper process, if there is one."""
        if self._orders >= 0:
            os.close(self._orders)
            self._orders = -1
        if self._job is not None:
            self._job.stop()
            self._job = None

    def _start(self) -> None:
        theirs, self._orders = os.pipe()
        try:
            self._job = Job(_previews, theirs, niceness=NICENESS, report=self._take, keep=(theirs,))
        finally:
            os.close(theirs)

    def _send(self, order: bytes) -> bool:
        """Send an order; return whether the process can still read it."""
        assert self._job is not None
        try:
            os.write(self._orders, order)
        except BrokenPipeError:
            return False
        return not self._job.poll()

    def _take(self, answer: object) -> None:
        self._answer = answer


def _previews(orders: int, report: Callable[[object], None]) -> None:
    """Answer the orders, in the helper process; the web process imports nothing that flies."""
    import_module(f"{PREFIX}control.behaviors.preview").previews(orders, report)
