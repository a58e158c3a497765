"""Betaflight's own logs (`.bbl`, `.bfl`): a table for each log of a file, as one is begun at each
arming. They are called "1", "2", "3", …; "" is the first one, too.

A log is a header of lines, `H NAME:VALUE`, with the names, predictors and encodings of the fields,
and frames behind it. `time` is in µs, `gyroADC` in deg/s and `accSmooth` in g; other columns are as
the firmware writes them.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Collection, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from extensions.importers.flights import FEWEST
from extensions.importers.readers import blackbox_frames as frames
from extensions.importers.readers.tables import FileTables
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

MAGIC = b"H Product:Blackbox flight data recorder by Nicholas Sherlock"
LINE = re.compile(rb"H ([^:\n]{1,200}):([^\n]{0,4000})\n")
GYROSCOPE, ACCELEROMETER = ("gyroADC", "gyroUnfilt"), ("accSmooth",)
PIECE = 1 << 24
"""Bytes in which beginnings of logs are searched at once."""
MOST_BYTES = 400_000_000
"""Largest log; a file of several may be larger."""
MOST_VALUES = 1 << 27
"""Largest number of values that a log can have by its length and its header."""
LONGEST_INTERVAL = 4096
"""Iterations between two I frames; firmware writes up to 1024."""
FIRST_YEAR, LAST_YEAR = 2000, 2105
RADIANS_BELOW = 1e-6
"""A smaller scale of the gyroscope is in rad/us, as Baseflight wrote it."""
DEGREES = 180.0 / np.pi


class Log(NamedTuple):
    """One log of a file."""

    header: Mapping[str, str]
    names: list[str]
    rows: npt.NDArray[np.int32]  # (N, len(names))
    damages: int
    ended: bool  # by its own mark
    left: int  # bytes behind the last whole frame
    is_erased: bool  # whether they are those of memory without a log


class BlackboxTables(FileTables):
    """The logs of a file; those that are not `wanted` are read for their length alone."""

    @classmethod
    def opened(cls, path: Path, wanted: Collection[str]) -> BlackboxTables:
        """Read the file. Raises LogFormatError."""
        return cls(path, wanted)

    def __init__(self, path: Path, wanted: Collection[str]) -> None:
        """Read the file. Raises LogFormatError."""
        super().__init__(path)
        self.units = {"time": "us"}
        with path.open("rb") as file:
            self._read(file, wanted)

    def _read(self, file: BinaryIO, wanted: Collection[str]) -> None:
        """Read the logs `wanted`, and the places of the others. Raises LogFormatError."""
        starts, size = _places(file)
        self.flights = [str(k + 1) for k in range(len(starts))]
        self._logs: dict[str, Log | None] = {}
        told = []
        for k, (start, end) in enumerate(zip(starts, [*starts[1:], size], strict=True)):
            name, where = str(k + 1), f"{self.path.name}, log {k + 1}"
            if name in wanted or (k == 0 and "" in wanted):
                if end - start > MOST_BYTES:
                    raise LogFormatError(
                        f"{where} has more than {MOST_BYTES // 10**6} MB: cut the file"
                    )
                self._logs[name] = log = _read(_piece(file, start, end - start), where)
                self._note(log, where, is_last=k == len(starts) - 1)
            else:
                self._logs[name] = None
            told.append(f"{k + 1} ({(end - start) / 1000:.0f} kB)")
        if len(starts) > 1:
            chosen = ", ".join(name for name, log in self._logs.items() if log)
            self.notes.append(
                f"{self.path.name} has {len(starts)} logs, one for each arming: {', '.join(told)}; "
                f"imported is {chosen or 'none'}, --table NUMBER imports another, --flight all "
                "each as a run"
            )

    def tables(self) -> list[str]:
        return ["", *self._logs]

    def columns(self, table: str) -> list[str]:
        # The accelerometer is always listed, so that `read` can say why there is none.
        names = self._log(table).names
        return [*names, *(one for one in _axes(ACCELEROMETER) if one not in names)]

    def read(self, table: str, names: list[str]) -> Array:
        log = self._log(table)
        if len(log.rows) < FEWEST and len(self._logs) > 1:
            raise LogFormatError(
                f"log {table or 1} has {len(log.rows)} frames, at least {FEWEST} are needed; "
                f"{self.notes[-1]}"
            )
        wanted = [one for one in names if one in _axes(ACCELEROMETER)]
        if wanted and (why := _no_accelerometer(log, wanted)):
            raise LogFormatError(
                f"{self.path.name}: the log has no accelerometer ({why}), without which a flight "
                "is not imported: switch it on in Betaflight (acc_hardware = AUTO, "
                "blackbox_disable_acc = OFF) and fly again"
            )
        return np.stack([_column(log, one) for one in names], axis=1)

    def _log(self, table: str) -> Log:
        found = self._logs[table or "1"]
        assert found is not None
        return found

    def _note(self, log: Log, where: str, *, is_last: bool) -> None:
        """Note what is wrong with a log that is imported."""
        if log.damages:
            self.notes.append(
                f"{where}: damaged in {log.damages} places; each is left out up to the next frame "
                "that stands alone"
            )
        if not log.ended and log.left and is_last and not log.is_erased:
            self.torn = f"it ends within a frame, {log.left} bytes behind the last whole one"
        elif not log.ended:
            self.notes.append(f"{where}: it has no end, as when the battery is taken out in flight")
        if self.epoch_ns is None and len(log.rows):
            self.epoch_ns = _epoch(log)


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


def _axes(names: Collection[str]) -> list[str]:
    return [f"{name}[{k}]" for name in names for k in range(3)]


def _column(log: Log, name: str) -> Array:
    """Return a column in the units of this module."""
    column = log.rows[:, log.names.index(name)]
    found: Array = column.astype(np.float64)
    stem = name.partition("[")[0]
    if name == "time":
        return column.view(np.uint32).astype(np.float64)
    if stem in GYROSCOPE:
        return found * _degrees(log.header)
    if stem in ACCELEROMETER:
        return found / _one_g(log.header)
    return found


def _no_accelerometer(log: Log, names: list[str]) -> str:
    """Return why a log has no accelerometer; empty if it has one."""
    if not _one_g(log.header):
        return "acc_1G in its header is 0 or missing"
    if not set(names) <= set(log.names):
        return "the fields accSmooth are missing"
    places = [log.names.index(one) for one in names]
    return "" if log.rows[:, places].any() else "its values are all 0"


def _one_g(header: Mapping[str, str]) -> int:
    """Return how many counts of the accelerometer are 1 g; 0 without one."""
    return max(int(header.get("acc_1G", "0")), 0)


def _degrees(header: Mapping[str, str]) -> float:
    """Return deg/s of a count of the gyroscope. Raises ValueError."""
    text = header.get("gyro_scale", header.get("gyro.scale", "0x3f800000"))
    (scale,) = struct.unpack(">f", int(text, 0).to_bytes(4, "big"))
    if abs(scale) < RADIANS_BELOW:
        scale *= 1e6 * DEGREES
    return float(scale) / (10.0 if header.get("blackbox_high_resolution", "0") != "0" else 1.0)


def _epoch(log: Log) -> int | None:
    """Return the time at which the log's clock was 0, ns, if the vehicle knew the date."""
    try:
        start = datetime.fromisoformat(log.header.get("Log start datetime", ""))
    except ValueError:  # the year 0, without a clock
        return None
    start = start if start.tzinfo else start.replace(tzinfo=UTC)
    if not FIRST_YEAR <= start.year <= LAST_YEAR:
        return None
    first = int(log.rows[:1, log.names.index("time")].view(np.uint32)[0])
    return round(start.timestamp() * 1e6) * 1000 - first * 1000


def _read(data: bytes, where: str) -> Log:
    """Read a log. Raises LogFormatError."""
    header, at = {}, 0
    while found := LINE.match(data, at):
        header[found[1].decode(errors="replace")] = found[2].decode(errors="replace").strip()
        at = found.end()
    try:
        names, fields = _fields(header)
        others, setting = _others(header), _setting(header, names, fields)
        _one_g(header), _degrees(header)
    except (KeyError, ValueError, OverflowError) as error:
        raise LogFormatError(f"{where}: its header cannot be read: {error!s:.120}") from None
    body = np.frombuffer(data, np.uint8)[at:]
    smallest = min(_smallest(fields[frames.I_ENCODING]), _smallest(fields[frames.P_ENCODING]))
    most = len(body) // smallest + 1
    if most * len(names) > MOST_VALUES:
        raise LogFormatError(f"{where}: {len(data) / 1e6:.0f} MB are too many: cut the file")
    rows = np.empty((most, len(names)), np.int32)
    state = np.zeros(frames.STATES, np.int64)
    past = np.zeros((3, max(8, len(names), others.shape[1]) + 8), np.int64)
    count = frames.decode(
        data=body, fields=fields, others=others, setting=setting, state=state, past=past, rows=rows
    )
    rest = data[at + int(state[frames.WHOLE_TO]) :]
    return Log(
        header,
        names,
        rows[:count],
        damages=int(state[frames.DAMAGED]) - int(state[frames.SEARCHES]),
        ended=bool(state[frames.ENDED]),
        left=len(rest),
        is_erased=not rest.strip(b"\0\xff"),
    )


def _listed(header: Mapping[str, str], kind: str, what: str) -> list[str]:
    """Return the items of a line about the fields of a kind. Raises KeyError."""
    return header[f"Field {kind} {what}"].split(",")


def _fields(header: Mapping[str, str]) -> tuple[list[str], frames.Numbers]:
    """Return names and description of the fields of main frames. Raises KeyError or ValueError."""
    names = _listed(header, "I", "name")
    lines = [_listed(header, "I", "signed")]
    for kind in "IP":
        lines += [_listed(header, kind, "predictor"), _listed(header, kind, "encoding")]
    table = np.array([[int(one) for one in line] for line in lines], np.int64)
    if table.shape != (5, len(names)) or len(set(names)) < len(names):
        raise ValueError("its lists of fields do not fit together")
    version = header.get("Data version", "2")
    for row in (frames.I_ENCODING, frames.P_ENCODING):
        table[row] = _encodings(table[row].tolist(), version)
    wrong = {*table[frames.I_PREDICTOR].tolist(), *table[frames.P_PREDICTOR].tolist()}
    if unknown := wrong - set(frames.PREDICTORS):
        raise ValueError(f"predictor {min(unknown)} is not known")
    return names, table


def _encodings(found: list[int], version: str) -> list[int]:
    """Return encodings as `blackbox_frames` numbers them. Raises ValueError."""
    if version == "1":
        found = [frames.TAG8_4S16_OLD if one == frames.TAG8_4S16 else one for one in found]
    if unknown := set(found) - frames.ENCODINGS:
        raise ValueError(f"encoding {min(unknown)} is not known")
    _smallest(found)
    return found


def _smallest(encodings: Collection[int]) -> int:
    """Return the smallest size of a frame in bytes. Raises ValueError for an incomplete group."""
    size, left, before = 1, 0, -1
    for one in map(int, encodings):
        if left and before not in (one, frames.TAG8_8SVB):
            break
        if not left or one != before:
            left = frames.GROUPS.get(one, 1)
            size += one != frames.NOTHING
        before, left = one, left - 1
    if left and before != frames.TAG8_8SVB:
        raise ValueError(f"a group of the encoding {before} is incomplete")
    return size


def _others(header: Mapping[str, str]) -> frames.Numbers:
    """Return the encodings of the other kinds of frames. Raises KeyError or ValueError."""
    version = header.get("Data version", "2")
    found = [
        _encodings([int(one) for one in _listed(header, kind, "encoding")], version)
        if f"Field {kind} encoding" in header
        else []
        for kind in "SGH"
    ]
    width = max(1, *map(len, found))
    padded = [[*one, *[frames.NOTHING] * (width - len(one))] for one in found]
    return np.array(padded, np.int64)


def _setting(header: Mapping[str, str], names: list[str], fields: frames.Numbers) -> frames.Numbers:
    """Return the numbers that decoding needs. Raises KeyError or ValueError."""
    part, _, of = header.get("P interval", "1/1").rpartition("/")
    setting = [
        names.index("loopIteration"),
        names.index("time"),
        names.index("motor[0]") if "motor[0]" in names else -1,
        int(header.get("I interval", "32")),
        int(part or "1"),
        int(of),
        int(header.get("minthrottle", "0")),
        int(header.get("vbatref", "0")),
        int(header.get("motorOutput", "0").partition(",")[0]),
    ]
    if setting[frames.P_OF] == 0:  # I frames alone
        setting[frames.P_OF] = setting[frames.I_INTERVAL]
    if setting[frames.I_INTERVAL] > LONGEST_INTERVAL:
        raise ValueError(f"its I interval is {setting[frames.I_INTERVAL]}")
    if min(setting[frames.I_INTERVAL : frames.MIN_THROTTLE]) < 1:
        raise ValueError("its intervals are no numbers above 0")
    for row in (frames.I_PREDICTOR, frames.P_PREDICTOR):
        for needed, word in {4: "minthrottle", 9: "vbatref", 11: "motorOutput"}.items():
            if needed in fields[row] and word not in header:
                raise ValueError(f"{word} is missing")
        if 5 in fields[row][: max(setting[frames.MOTOR0], 0) + 1] or (
            5 in fields[row] and setting[frames.MOTOR0] < 0
        ):
            raise ValueError("motor[0] is missing before the other motors")
    return np.array(setting, np.int64)
