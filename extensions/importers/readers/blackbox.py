"""Betaflight's own logs (`.bbl`, `.bfl`): a table for each log of a file, as one is begun at each
arming. They are called "1", "2", "3", …; "" is the first one, too.

A log is a header of lines, `H NAME:VALUE`, and frames behind it. `time` is in µs, `gyroADC` in
deg/s and `accSmooth` in g; other columns are as the firmware writes them.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO

import numpy as np

from extensions.importers.flights import FEWEST
from extensions.importers.readers import blackbox_frames as frames
from extensions.importers.readers.blackbox_header import Log, degrees, described, one_g, smallest
from extensions.importers.readers.progress import tell
from extensions.importers.readers.tables import FileTables
from extensions.importers.rows import Spilled, release
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

MAGIC = b"H Product:Blackbox flight data recorder by Nicholas Sherlock"
GYROSCOPE, ACCELEROMETER = ("gyroADC", "gyroUnfilt"), ("accSmooth",)
PIECE = 1 << 22
"""Bytes that are searched for beginnings of logs, or decoded, at once."""
LONGEST_FRAME = 1 << 16
"""More bytes than any frame has."""
MOST_FRAMES = 12_000_000
"""Largest number of frames read from a log: 25 min at 8 kHz."""
FIRST_YEAR, LAST_YEAR = 2000, 2105


class BlackboxTables(FileTables):
    """The logs of a file; of those that are not `wanted` only the length is known."""

    def __init__(self, path: Path, wanted: Collection[str]) -> None:
        """Open the file. Raises LogFormatError."""
        super().__init__(path)
        self.units = {"time": "us"}
        self._listed = ""
        with path.open("rb") as file:
            self._open(file, wanted)

    def _open(self, file: BinaryIO, wanted: Collection[str]) -> None:
        """Read the headers of the logs `wanted`, and the places of all. Raises LogFormatError."""
        starts, size = _places(file)
        self.flights = [str(k + 1) for k in range(len(starts))]
        self._logs: dict[str, Log | None] = {}
        told = []
        for k, (start, end) in enumerate(zip(starts, [*starts[1:], size], strict=True)):
            name, where = str(k + 1), f"{self.path.name}, log {k + 1}"
            is_wanted = name in wanted or (k == 0 and "" in wanted)
            head = _piece(file, start, min(PIECE, end - start)) if is_wanted else b""
            found = described(head, where, start, end, is_last=end == size) if is_wanted else None
            self._logs[name] = found
            told.append(f"{k + 1} ({(end - start) / 1000:.0f} kB)")
        if len(starts) > 1:
            chosen = ", ".join(name for name, log in self._logs.items() if log)
            self._listed = (
                f"{self.path.name} has {len(starts)} logs, one for each arming: {', '.join(told)}; "
                f"imported is {chosen or 'none'}, --table NUMBER imports another, --flight all "
                "each as a run"
            )
            self.note(self._listed)

    def tables(self) -> list[str]:
        return ["", *self._logs]

    def columns(self, table: str) -> list[str]:
        # The accelerometer is always listed, so that `read` can say why there is none.
        names = self._log(table).names
        return [*names, *(one for one in _axes(ACCELEROMETER) if one not in names)]

    def read(self, table: str, names: list[str]) -> Array:
        log = self._log(table)
        force = [k for k, one in enumerate(names) if one in _axes(ACCELEROMETER)]
        if force and (why := _no_accelerometer(log)):
            raise self._without_accelerometer(why)
        rows = self._decoded(log, names)
        if len(rows) < FEWEST and self._listed:
            raise LogFormatError(
                f"log {table or 1} has {len(rows)} frames, at least {FEWEST} are needed; "
                f"{self._listed}"
            )
        if force and len(rows) and not any(rows[:, k].any() for k in force):
            raise self._without_accelerometer("its values are all 0")
        if "time" in names and self.epoch_ns is None and len(rows):
            self.epoch_ns = _epoch(log.header, int(rows[0, names.index("time")]))
        for k, name in enumerate(names):
            if scale := _scale(log.header, name):
                rows[:, k] *= scale
                release(rows)
        return rows

    def _without_accelerometer(self, why: str) -> LogFormatError:
        return LogFormatError(
            f"{self.path.name}: the log has no accelerometer ({why}), without which a flight is "
            "not imported: switch it on in Betaflight (acc_hardware = AUTO, "
            "blackbox_disable_acc = OFF) and fly again"
        )

    def _log(self, table: str) -> Log:
        found = self._logs[table or "1"]
        assert found is not None
        return found

    def _decoded(self, log: Log, names: list[str]) -> Array:
        """Return columns as the firmware writes them, (N, len(names)), and note what is wrong with
        the log. Raises LogFormatError.
        """
        columns = np.array([log.names.index(one) for one in names], np.int64)
        state = np.zeros(frames.STATES, np.int64)
        state[frames.LAST_I] = -1
        past = np.zeros((3, max(8, len(log.names), log.others.shape[1]) + 8), np.int64)
        shortest = min(map(smallest, log.fields[[frames.I_ENCODING, frames.P_ENCODING]].tolist()))
        most = min((log.end - log.begin) // shortest + 1, MOST_FRAMES)
        at = whole = log.begin
        with self.path.open("rb") as file, closing(Spilled(len(names), most + 1)) as table:
            while at < log.end and not state[frames.ENDED]:
                tell((at - log.begin) / (log.end - log.begin))
                data = _piece(file, at, min(PIECE, log.end - at))
                stop = len(data) - (LONGEST_FRAME if at + len(data) < log.end else 0)
                state[frames.AT], state[frames.WHOLE_TO] = 0, whole - at
                table.make_room(int(state[frames.COUNT]), len(data) // shortest + 1)
                frames.decode(
                    data=np.frombuffer(data, np.uint8),
                    stop=stop,
                    fields=log.fields,
                    others=log.others,
                    setting=log.setting,
                    state=state,
                    past=past,
                    columns=columns,
                    rows=table.columns,
                )
                if state[frames.COUNT] > most:
                    raise LogFormatError(
                        f"{log.where} has more than {most} frames, which are too many for an "
                        "import: cut the file"
                    )
                release(table.columns)
                at, whole = at + int(state[frames.AT]), at + int(state[frames.WHOLE_TO])
            is_erased = _is_erased(file, whole, log.end)
        self._note(log, state, left=log.end - whole, is_erased=is_erased)
        found = table.columns[:, : state[frames.COUNT]].T
        if "time" in names:
            found[:, names.index("time")] %= 2.0**32  # also of a log that calls it signed
        return found

    def _note(self, log: Log, state: frames.Numbers, *, left: int, is_erased: bool) -> None:
        """Note what is wrong with a log that was read.

        Args:
            left: bytes behind its last whole frame.
            is_erased: whether they are those of memory without a log.
        """
        if damages := int(state[frames.DAMAGED]) - int(state[frames.SEARCHES]):
            self.note(
                f"{log.where}: damaged in {damages} places; each is left out up to the next frame "
                "that stands alone"
            )
        if state[frames.ENDED]:
            return
        if left and log.is_last and not is_erased:
            self.torn = f"it ends within a frame, {left} bytes behind the last whole one"
        else:
            self.note(f"{log.where}: it has no end, as when the battery is taken out in flight")


def _places(file: BinaryIO) -> tuple[list[int], int]:
    """Return where logs begin, and the size of the file."""
    starts: list[int] = []
    at, before = 0, b""
    while data := file.read(PIECE):
        found = re.finditer(re.escape(MAGIC), before + data)
        starts += [at - len(before) + one.start() for one in found]
        at, before = at + len(data), (before + data)[1 - len(MAGIC) :]
    return starts, at


def _piece(file: BinaryIO, start: int, size: int) -> bytes:
    file.seek(start)
    return file.read(size)


def _is_erased(file: BinaryIO, start: int, end: int) -> bool:
    """Return whether bytes are those of memory without a log."""
    pieces = (_piece(file, at, min(PIECE, end - at)) for at in range(start, end, PIECE))
    return not any(one.strip(b"\0\xff") for one in pieces)


def _axes(names: Collection[str]) -> list[str]:
    return [f"{name}[{k}]" for name in names for k in range(3)]


def _scale(header: Mapping[str, str], name: str) -> float | None:
    """Return by what a column is multiplied for the units of this module; None for others."""
    stem = name.partition("[")[0]
    if stem in GYROSCOPE:
        return degrees(header)
    return 1.0 / one_g(header) if stem in ACCELEROMETER else None


def _no_accelerometer(log: Log) -> str:
    """Return why a log has no accelerometer by its header; empty if it has one."""
    if not one_g(log.header):
        return "acc_1G in its header is 0 or missing"
    if not set(_axes(ACCELEROMETER)) <= set(log.names):
        return "the fields accSmooth are missing"
    return ""


def _epoch(header: Mapping[str, str], first_us: int) -> int | None:
    """Return the time at which the log's clock was 0, ns, if the vehicle knew the date."""
    try:
        start = datetime.fromisoformat(header.get("Log start datetime", ""))
    except ValueError:  # the year 0, without a clock
        return None
    start = start if start.tzinfo else start.replace(tzinfo=UTC)
    if not FIRST_YEAR <= start.year <= LAST_YEAR:
        return None
    return round(start.timestamp() * 1e6) * 1000 - first_us * 1000
