"""The vehicle's store of calibrations: every stored record as one JSON line on disk.

`calibrations/history.jsonl` in the data folder is append-only; each line is synced to disk before
it is reported as stored. A line that is not a record, because of a power cut or another writer, is
moved to `set_aside.jsonl` next to it. The gyroscope's drift, which the vehicle uses as soon as it
is found, before anyone accepts it, replaces a file: `at_start.json` at each start,
`on_request.json` on request. In the history it would add a line at each start.

Only the comms process writes; the parent process reads and repairs the store before it starts
comms.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

from quadrotor.calibration_record import CalibrationRecord, parse_record
from quadrotor.errors import MeasurementError, StorageError

FOLDER = "calibrations"
HISTORY, SET_ASIDE = "history.jsonl", "set_aside.jsonl"
AT_START, ON_REQUEST = "at_start.json", "on_request.json"
RECORD_BYTES_MAX = 32_000

Say = Callable[[str], None]


class CalibrationStore:
    """Calibration records in memory and on disk; thread-safe.

    Args:
        data: the vehicle's data folder.
        say: called with a line about unusable content.
    """

    def __init__(self, data: Path, say: Say) -> None:
        self._folder = data / FOLDER
        self._say = say
        self._lock = threading.Lock()
        self._history: list[CalibrationRecord] = []
        self._found: dict[str, CalibrationRecord] = {}  # by file
        self._unread = ""
        with self._lock:
            self._load()

    def newest_first(self) -> list[CalibrationRecord]:
        """Return the history and the drift found at start-up, in the order of storage.

        Stamps do not decide the order, because a clock may have been wrong. A drift found on
        request is included only once it is accepted.
        """
        return self._with_found(AT_START)[::-1]

    def newest(self) -> list[CalibrationRecord]:
        """Return the newest record of each name, oldest first, including found drifts."""
        newest: dict[str, CalibrationRecord] = {}
        for record in reversed(self._with_found(AT_START, ON_REQUEST)):
            newest.setdefault(record.name, record)
        return list(newest.values())[::-1]

    def append(self, record: CalibrationRecord) -> None:
        """Append to the history, synced when this returns. Raises StorageError if not stored."""
        line = encoded(record)
        with self._lock:
            if self._unread:  # do not append to a file that cannot be read
                raise StorageError(f"calibration not stored: {self._unread}")
            try:
                self._folder.mkdir(parents=True, exist_ok=True)
                _append(self._folder / HISTORY, line)
            except OSError as error:
                why = error.strerror or str(error)
                raise StorageError(
                    f"calibration not stored in {self._folder}: {why}; free some space or repair "
                    "the disk, then accept it again"
                ) from error
            self._history.append(record)

    def replace(self, file: str, record: CalibrationRecord) -> None:
        """Replace the found drift in the file AT_START or ON_REQUEST.

        Raises StorageError when it is not stored; the drift is in use nevertheless.
        """
        with self._lock:
            self._found[file] = record
            try:
                self._folder.mkdir(parents=True, exist_ok=True)
                _replace(self._folder / file, encoded(record))
            except OSError as error:
                why = error.strerror or str(error)
                raise StorageError(
                    f"calibration {record.name} is in use but not kept in {self._folder}: {why}"
                ) from error

    def _with_found(self, *files: str) -> list[CalibrationRecord]:
        """Return the history, oldest first, with these records inserted by stamp."""
        with self._lock:
            kept = list(self._history)
            found = [self._found[file] for file in files if file in self._found]
        for one in sorted(found, key=lambda record: record.stamp_ns):
            later = (k for k, other in enumerate(kept) if other.stamp_ns > one.stamp_ns)
            kept.insert(next(later, len(kept)), one)
        return kept

    # ------------------------------------------------------------------ reading
    def _load(self) -> None:
        for name in (HISTORY, AT_START, ON_REQUEST):
            path = self._folder / name
            try:
                lines = path.read_bytes().splitlines()
            except FileNotFoundError:
                continue
            except OSError as error:
                problem = f"{path} cannot be read: {error.strerror or error}"
                self._say(f"{problem}; calibrations in it are not in force")
                if name == HISTORY:
                    self._unread = problem
                continue
            kept, foreign, why = _sorted_out(lines)
            if name == HISTORY:
                self._history = kept
            elif kept:
                self._found[name] = kept[-1]
            if foreign:
                self._set_aside(path, kept, foreign, why)

    def _set_aside(
        self, path: Path, kept: Iterable[CalibrationRecord], foreign: list[bytes], why: str
    ) -> None:
        count = "a line" if len(foreign) == 1 else f"{len(foreign)} lines"
        try:
            for (
                line
            ) in foreign:  # appended first: a crash in between may duplicate lines, not lose any
                _append(self._folder / SET_ASIDE, line + b"\n")
            _replace(path, b"".join(map(encoded, kept)))
        except OSError as error:
            self._say(
                f"{path} holds {count} that cannot be used ({why}); left there: "
                f"{error.strerror or error}"
            )
        else:
            self._say(f"{path} held {count} that cannot be used ({why}); moved to {SET_ASIDE}")


def encoded(record: CalibrationRecord) -> bytes:
    """Return the record as one line."""
    return record.model_dump_json().encode() + b"\n"


def parse_stored(line: bytes) -> CalibrationRecord:
    """Parse a stored line. Raises MeasurementError with the reason why it is not a record."""
    if len(line) > RECORD_BYTES_MAX:
        raise MeasurementError(
            f"not a calibration record: {len(line)} bytes long, at most {RECORD_BYTES_MAX}"
        )
    try:
        text = line.decode()
    except UnicodeDecodeError:
        raise MeasurementError("not a calibration record: not UTF-8 text") from None
    return parse_record(text)


def _sorted_out(lines: list[bytes]) -> tuple[list[CalibrationRecord], list[bytes], str]:
    """Return the records, the invalid lines, and what is wrong with the first of those."""
    kept, foreign, why = list[CalibrationRecord](), list[bytes](), ""
    for line in lines:
        if not line.strip():
            continue
        try:
            kept.append(parse_stored(line))
        except MeasurementError as error:
            foreign.append(line)
            why = why or str(error)
    return kept, foreign, why


def _append(path: Path, line: bytes) -> None:
    """Append a complete line and sync it, or change nothing. Raises OSError."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        size = os.fstat(descriptor).st_size
        torn = size > 0 and os.pread(descriptor, 1, size - 1) != b"\n"
        try:
            _write_all(descriptor, b"\n" * torn + line)
            os.fsync(descriptor)
        except OSError:
            with suppress(OSError):
                os.ftruncate(descriptor, size)
            raise
    finally:
        os.close(descriptor)
    _sync_folder(path.parent)


def _replace(path: Path, content: bytes) -> None:
    """Replace the content atomically. Raises OSError."""
    part = path.with_suffix(".part")
    try:
        descriptor = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
        try:
            _write_all(descriptor, content)
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        part.replace(path)
    except OSError:
        part.unlink(missing_ok=True)
        raise
    _sync_folder(path.parent)


def _write_all(descriptor: int, data: bytes) -> None:
    while data:
        data = data[os.write(descriptor, data) :]


def _sync_folder(folder: Path) -> None:
    from flight_log.file import sync_folder  # late: the flight process loads no log

    sync_folder(folder)
