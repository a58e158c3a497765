"""Queries of the onboard log: numbers of every tick between two instants.

They run on a thread of the comms process, with small answers, next to the log's own thread, the
radio and the flight process.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from flight_log.tick_columns import Columns, read_columns
from quadrotor.errors import RefusedError
from vehicle.onboard_log.file import Written
from vehicle.onboard_log.onboard_log import OnboardLog
from vehicle_link.messages import Message, new
from vehicle_link.messages.records import OnboardLogRequest
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.idempotent import prepare

TYPE = SERVICES["onboard_log"]
COLUMNS_MAX = 48
VALUES_MAX = 16_000
"""Largest number of values in an answer: 64 kB, one fragment of the link."""
PATIENCE_S = 0.3
"""Time, in s, for which an answer waits for ticks on their way to the file: chunks take 40 ms."""
LOOK_S = 0.02
LONGEST_NS = 120_000_000_000


class OnboardReader:
    """Service `onboard_log`.

    Args:
        log: may be written at the same time.
        wait: waits this many s between two reads.
    """

    def __init__(
        self, log: OnboardLog, vehicle: str, wait: Callable[[float], None] = time.sleep
    ) -> None:
        self._log = log
        self._vehicle = vehicle
        self._wait = wait
        prepare(TYPE)

    def answer(self, request: OnboardLogRequest) -> Message:
        """Answer a request of the service. Raises RefusedError, UsageError or StorageError."""
        start_ns, end_ns = int(request.start_ns), int(request.end_ns)
        if not 0 <= end_ns - start_ns <= LONGEST_NS:
            raise RefusedError(
                f"from {start_ns} to {end_ns} ns is not a part of the log; allowed are up to "
                f"{LONGEST_NS // 10**9} s"
            )
        count = len(request.columns)
        if not 1 <= count <= COLUMNS_MAX:
            raise RefusedError(f"{count} columns; allowed are 1 to {COLUMNS_MAX} in a question")
        most = VALUES_MAX // count
        rows = min(int(request.rows) or most, most)
        written = self._file_of(start_ns)
        waited = 0.0
        while True:
            is_whole = written.closed  # before reading: the file cannot grow afterwards
            found = self._read(written, request, rows)
            enough = len(found.stamps_ns) >= rows or found.written_ns >= end_ns
            if enough or is_whole or found.ended or waited >= PATIENCE_S:
                break
            self._wait(LOOK_S)
            waited += LOOK_S
        reached = found.written_ns >= end_ns or is_whole or found.ended
        # With as many as were requested there may be more.
        complete = reached and len(found.stamps_ns) < rows
        return new(
            f"{TYPE}_Response",
            accepted=True,
            file=written.path.name,
            stamps_ns=found.stamps_ns,
            values=found.values.ravel(),
            written_ns=found.written_ns,
            complete=complete,
            damaged=found.damaged,
        )

    def _read(self, written: Written, request: OnboardLogRequest, rows: int) -> Columns:
        return read_columns(
            written.path,
            self._vehicle,
            request.columns,
            int(request.start_ns),
            int(request.end_ns),
            rows=rows,
            offset=written.place_before(int(request.start_ns)),
        )

    def _file_of(self, start_ns: int) -> Written:
        """Return the newest file that began before this instant, or else the oldest one known."""
        files = self._log.files()
        if not files:
            why = self._log.problem or "it is written while the vehicle is armed"
            raise RefusedError(f"there is no onboard log of this flight: {why}")
        for written in reversed(files):
            if written.start_ns <= start_ns:
                return written
        return files[0]
