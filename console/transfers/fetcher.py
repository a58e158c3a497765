"""Fetches a file on board into its part file, with several requests in flight.

Telemetry queues behind requests in flight, so there are only as many as increase the rate (window).
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

from console.transfers.part_file import PartFile
from console.transfers.vehicle_files import VehicleFile, VehicleFiles
from console.transfers.window import MOST, Window
from quadrotor.errors import LinkError, QuadlabError

RATE_WINDOW = 3.0
"""Seconds over which the rate is computed."""


class ChangedError(QuadlabError):
    """The received bytes are not, or no longer, those of the file of that name on board."""


class Rate:
    """Bytes a second, of what arrived within the last RATE_WINDOW."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._came: deque[tuple[float, int]] = deque([(clock(), 0)])
        self._total = 0

    def came(self, count: int) -> float:
        now = self._clock()
        self._total += count
        self._came.append((now, self._total))
        while len(self._came) > 2 and now - self._came[0][0] > RATE_WINDOW:
            self._came.popleft()
        since, before = self._came[0]
        return (self._total - before) / max(now - since, 1e-3)


class Fetcher:
    """Fetches files in pieces.

    Args:
        files: called from several threads.
        came: called with the number of bytes of each stored piece; may raise to end the fetch.
    """

    def __init__(self, files: VehicleFiles, came: Callable[[int], None]) -> None:
        self._files = files
        self._came = came
        self._pool = ThreadPoolExecutor(MOST, thread_name_prefix="fetch")
        self._window = Window()

    def close(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)

    def fetch(self, part: PartFile) -> None:
        """Fetch what `part` lacks; received pieces stay, whatever is raised.

        Raises ChangedError, LinkError, RefusedError, StorageError.
        """
        pieces = part.pieces()
        asked: deque[tuple[int, int, Future[tuple[VehicleFile, bytes]]]] = deque()
        try:
            while True:
                while len(asked) < self._window.size and (piece := next(pieces, None)):
                    question = self._pool.submit(self._ask, part.file.name, *piece)
                    asked.append((*piece, question))
                if not asked:
                    return
                offset, length, question = asked.popleft()
                file, data = question.result()
                if file.identity != part.file.identity:
                    raise ChangedError(f"{file.name} is another file on board now")
                if len(data) != length:
                    raise LinkError(
                        f"{len(data)} bytes of {file.name} at {offset} came instead of {length}"
                    )
                part.put(data)
                self._came(length)
        finally:
            for _, _, question in asked:
                question.cancel()

    def _ask(self, name: str, offset: int, length: int) -> tuple[VehicleFile, bytes]:
        size, began = self._window.size, time.monotonic()
        answer = self._files.part(name, offset, length)
        self._window.answered(size, time.monotonic() - began)
        return answer
