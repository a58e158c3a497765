"""The log protocol: the runs of the station's data folder as files to download."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from console.catalogue.catalogue import Catalogue
from console.catalogue.tables import RunEntry
from extensions.mavlink.dialect import MAVLink_message, mavlink
from extensions.mavlink.peer import Peer
from flight_log.run_folder import log_of
from quadrotor.errors import StorageError, os_errors

PIECE = 90
"""Bytes of one LOG_DATA."""
RUNS_MOST = 200
LARGEST = 2**32 - 1


class Logs:
    """The runs, oldest first; their numbers are those of the last listing."""

    def __init__(self, catalogue: Catalogue, vehicle: str) -> None:
        self._catalogue, self._vehicle = catalogue, vehicle
        self._files: list[tuple[RunEntry, Path, int]] = []

    def list_to(self, peer: Peer, message: MAVLink_message) -> None:
        """Answer a LOG_REQUEST_LIST, piece by piece."""
        peer.waiting["logs"] = self._listed(message.start, message.end)

    def send_to(self, peer: Peer, message: MAVLink_message) -> None:
        """Answer a LOG_REQUEST_DATA, piece by piece."""
        peer.waiting["log"] = self._pieces(message.id, message.ofs, message.count)

    def end(self, peer: Peer, message: MAVLink_message) -> None:
        """Send no more of a log."""
        peer.waiting.pop("log", None)

    def _listed(self, first: int, last: int) -> Iterator[MAVLink_message]:
        """Yield LOG_ENTRY of the runs from number `first` to `last`; one with no runs when there
        are none. Raises StorageError.
        """
        found = []
        for run in reversed(self._catalogue.runs(vehicle=self._vehicle, limit=RUNS_MOST)):
            try:
                file = log_of(self._catalogue.resolve(run.id))
                size = file.stat().st_size
            except (StorageError, OSError):
                continue  # its file is gone; the Runs page tells that
            if run.complete and 0 < size <= LARGEST:
                found.append((run, file, size))
        self._files = found
        count = len(found)
        if not count:
            yield mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0)
        for number, (run, _, size) in enumerate(found):
            if first <= number <= last:
                seconds = run.start_ns // 1_000_000_000
                yield mavlink.MAVLink_log_entry_message(number, count, count - 1, seconds, size)

    def _pieces(self, number: int, start: int, count: int) -> Iterator[MAVLink_message]:
        """Yield LOG_DATA of a part of a run's file. Raises StorageError for one not listed."""
        if not 0 <= number < len(self._files):
            raise StorageError(f"there is no log {number}; list the logs first")
        _, path, size = self._files[number]
        end = min(start + count, size)
        with os_errors(lambda why: f"{path} cannot be read: {why}"), path.open("rb") as file:
            file.seek(start)
            while start < end:
                data = file.read(min(PIECE, end - start))
                if not data:
                    return
                padded = list(data.ljust(PIECE, b"\0"))
                yield mavlink.MAVLink_log_data_message(number, start, len(data), padded)
                start += len(data)
