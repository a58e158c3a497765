"""Fetches a file on board into its part file, with several requests in flight.

Telemetry queues behind requests in flight, so there are only as many as increase the rate (window).
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

from console.transfers.part_file import PartFile
from console.transfers.request_window import MAX_REQUESTS, RequestWindow
from console.transfers.vehicle_files import VehicleFile, VehicleFiles
from quadrotor.errors import LinkError, QuadlabError

RATE_WINDOW = 3.0
"""Seconds over which the rate is computed."""


class ChangedError(QuadlabError):
    """The received bytes do not belong to the file of that name on board, or no longer do."""


class TransferRate:
    """Bytes a second, of what arrived within the last RATE_WINDOW."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, int]] = deque([(time.monotonic(), 0)])
        self._total = 0

    def add(self, count: int) -> float:
        """Return the rate after this many more bytes."""
        now = time.monotonic()
        self._total += count
        self._samples.append((now, self._total))
        while len(self._samples) > 2 and now - self._samples[0][0] > RATE_WINDOW:
            self._samples.popleft()
        since, before = self._samples[0]
        return (self._total - before) / max(now - since, 1e-3)


class Fetcher:
    """Fetches files in pieces.

    Args:
        files: called from several threads.
        on_piece: called with the number of bytes of each stored piece; may raise to end the fetch.
    """

    def __init__(self, files: VehicleFiles, on_piece: Callable[[int], None]) -> None:
        self._files = files
        self._on_piece = on_piece
        self._pool = ThreadPoolExecutor(MAX_REQUESTS, thread_name_prefix="fetch")
        self._window = RequestWindow()

    def close(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)

    def fetch(self, part: PartFile) -> None:
        """Fetch the missing pieces of `part`; received pieces stay, even when an error is raised.

        Raises ChangedError, LinkError, RefusedError, StorageError.
        """
        pieces = part.pieces()
        in_flight: deque[tuple[int, int, Future[tuple[VehicleFile, bytes]]]] = deque()
        try:
            while True:
                while len(in_flight) < self._window.size and (piece := next(pieces, None)):
                    request = self._pool.submit(self._ask, part.file.name, *piece)
                    in_flight.append((*piece, request))
                if not in_flight:
                    return
                offset, length, request = in_flight.popleft()
                file, data = request.result()
                if file.identity != part.file.identity:
                    raise ChangedError(f"{file.name} has changed on board")
                if len(data) != length:
                    raise LinkError(
                        f"{len(data)} bytes of {file.name} at {offset} arrived instead of {length}"
                    )
                part.put(data)
                self._on_piece(length)
        finally:
            for _, _, request in in_flight:
                request.cancel()

    def _ask(self, name: str, offset: int, length: int) -> tuple[VehicleFile, bytes]:
        size, began = self._window.size, time.monotonic()
        answer = self._files.part(name, offset, length)
        self._window.answered(size, time.monotonic() - began)
        return answer
