"""ArduPilot's logs (DataFlash, `.bin`): a table for each message, its instance K as NAME#K.

A message begins with A3 95 and the number of its kind. Those of the kind 0x80, `FMT`, describe the
kinds: number, length, name, a letter for each field, and the fields' names. `FMTU` says with a `#`
which field is the instance. The library that reads these files, pymavlink's DFReader, is under the
GPL and therefore not used.
"""

from __future__ import annotations

import re
import struct
from array import array
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from extensions.importers.readers.tables import FileTables
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

START, FMT = b"\xa3\x95", 0x80
FORMAT = struct.Struct("<BB4s16s64s")
CONTENT = re.compile(rb"[^\0\xff]")
"""Any byte but those of unwritten memory."""
NUMBERS = {
    **{"b": ("i1", 1), "B": ("u1", 1), "M": ("u1", 1), "h": ("<i2", 1), "H": ("<u2", 1)},
    **{"i": ("<i4", 1), "I": ("<u4", 1), "q": ("<i8", 1), "Q": ("<u8", 1)},
    **{"g": ("<f2", 1), "f": ("<f4", 1), "d": ("<f8", 1), "L": ("<i4", 1e7)},
    **{"c": ("<i2", 100), "C": ("<u2", 100), "e": ("<i4", 100), "E": ("<u4", 100)},
}
"""Type of a field by its letter, and by which number its values are divided."""
TEXTS = {"n": "S4", "N": "S16", "Z": "S64", "a": "V64"}
TIME, OLD_TIME = "TimeUS", "TimeMS"
"""Columns of time in µs, and in ms as firmware until 2015 wrote it, from which TIME is made."""
GPS_EPOCH, LEAP, WEEK = 315_964_800, 18, 604_800  # s: 1980-01-06 since 1970; until UTC, since 2017
LAST_WEEK = 6600  # 2106
INFO = 20  # level of rcl_interfaces/Log
PIECE = 1 << 22
"""Bytes that are searched for messages at once."""
Places = npt.NDArray[np.int64]


class Kind(NamedTuple):
    """One kind of messages."""

    name: str
    size: int
    letters: dict[str, str]  # of its fields
    layout: np.dtype[np.void]


HEAD = Kind("FMT", 89, {}, np.dtype([]))


class DataFlashTables(FileTables):
    """The messages `wanted` that the log has."""

    def __init__(self, path: Path, wanted: Collection[str]) -> None:
        """Read the log. Raises LogFormatError."""
        super().__init__(path)
        self.units = {TIME: "us", OLD_TIME: "ms"}
        data = path.read_bytes()
        names = {one.partition("#")[0] for one in wanted} | {"FMTU", "MSG", "GPS"}
        kinds, places, others = self._walk(data, names)
        raw = np.frombuffer(data, np.uint8)
        rows = {
            number: sliding_window_view(raw, kinds[number].size)[found]
            .view(kinds[number].layout)
            .reshape(-1)
            for number, found in places.items()
        }
        found = {kinds[number].name: (kinds[number], rows[number]) for number in rows}
        instances = _instances(kinds, found.pop("FMTU", None))
        self._letters = {kind.name: kind.letters for kind, _ in found.values()}
        self._rows: dict[str, npt.NDArray[np.void] | None] = dict.fromkeys(others)
        for name, (_, table) in found.items():
            self._rows |= _split(name, table, instances.get(name))
        self.epoch_ns = _epoch(self._rows.get("GPS"))
        self.events = _texts(self._rows.get("MSG"))

    def tables(self) -> list[str]:
        return list(self._rows)

    def columns(self, table: str) -> list[str]:
        found = [name for name, one in self._letters[_stem(table)].items() if one in NUMBERS]
        return [TIME, *found] if OLD_TIME in found and TIME not in found else found

    def read(self, table: str, names: list[str]) -> Array:
        rows, letters = self._rows[table], self._letters[_stem(table)]
        assert rows is not None
        columns = []
        for name in names:
            is_old = name == TIME and name not in letters
            stored = OLD_TIME if is_old else name
            with np.errstate(invalid="ignore"):  # NaN of any kind
                found = rows[stored].astype(np.float64)
            found /= NUMBERS[letters[stored]][1]
            columns.append(1000.0 * found if is_old else found)
        return np.stack(columns, axis=1)

    def _walk(
        self, data: bytes, names: Collection[str]
    ) -> tuple[dict[int, Kind], dict[int, Places], list[str]]:
        """Return the kinds, the places of messages of these names, and the other names.

        Raises LogFormatError.
        """
        kinds = {**_described_later(data, self.path.name), FMT: HEAD}
        sizes = [kinds[number].size if number in kinds else 0 for number in range(256)]
        raw, found, due, damages = np.frombuffer(data, np.uint8), array("q"), 0, 0
        for at in _starts(raw):
            for place, number in zip(at.tolist(), raw[at + 2].tolist(), strict=True):
                if place < due or not sizes[number]:
                    continue
                damages += place > due and CONTENT.search(data, due, place) is not None
                due = place + sizes[number]
                if number == FMT and due <= len(data):
                    described, kind = _kind(data, place, self.path.name)
                    kinds[described], sizes[described] = kind, kind.size
                found.append(place)
        if due > len(data):
            self.torn = f"it ends within a message at byte {found.pop()}"
        damages += CONTENT.search(data, due, len(data) - 2) is not None
        if damages:
            self.notes.append(f"{self.path.name}: damaged in {damages} places, which are left out")
        every = np.frombuffer(found, np.int64)
        numbers = raw[every + 2]
        seen = set(np.unique(numbers).tolist()) - {FMT}
        places = {one: every[numbers == one] for one in seen if kinds[one].name in names}
        return kinds, places, [kinds[one].name for one in sorted(seen - places.keys())]


def _starts(raw: npt.NDArray[np.uint8]) -> Iterator[Places]:
    """Yield where messages may begin, some at a time."""
    for begin in range(0, len(raw) - 2, PIECE):
        piece = raw[begin : begin + PIECE + 2]
        yield begin + np.flatnonzero((piece[:-2] == START[0]) & (piece[1:-1] == START[1]))


def _stem(table: str) -> str:
    return table.partition("#")[0]


def _kind(data: bytes, at: int, name: str) -> tuple[int, Kind]:
    """Return number and description of the kind that an `FMT` describes. Raises LogFormatError."""
    number, size, *texts = FORMAT.unpack_from(data, at + 3)
    title, letters, fields = (one.split(b"\0")[0].decode("latin-1") for one in texts)
    title = re.sub(r"\W", "?", title, flags=re.ASCII)
    columns = [one for one in fields.split(",") if one]
    known = [NUMBERS[one][0] if one in NUMBERS else TEXTS.get(one, "") for one in letters]
    layout = None
    words = all(re.fullmatch(r"\w{1,16}", one, re.ASCII) for one in columns)
    if words and all(known) and len(columns) == len(known) == len(set(columns)):
        layout = np.dtype([("", "V3"), *zip(columns, known, strict=True)])
    if layout is None or layout.itemsize != size:
        layout = np.dtype([("", f"V{max(size, 3)}")])  # a kind without columns
        columns, letters = [], ""
    if size < 3:
        raise LogFormatError(f"{name}: messages {title!r:.20} of {size} bytes cannot be")
    return number, Kind(title, size, dict(zip(columns, letters, strict=True)), layout)


def _described_later(data: bytes, name: str) -> dict[int, Kind]:
    """Return the kinds of which messages may precede the description, as in a log that was begun in
    flight.
    """
    found: dict[int, Kind] = {}
    at, mark = -1, START + bytes([FMT])
    while (at := data.find(mark, at + 1)) >= 0 and at + HEAD.size <= len(data):
        if data[at + 4] >= 3:
            number, kind = _kind(data, at, name)
            if kind.letters:  # a description that is consistent, and no other bytes
                found.setdefault(number, kind)
    return found


def _instances(
    kinds: dict[int, Kind], units: tuple[Kind, npt.NDArray[np.void]] | None
) -> dict[str, str]:
    """Return the field of the instance by the name of the kind, as `FMTU` says."""
    if units is None or not {"FmtType", "UnitIds"} <= units[0].letters.keys():
        return {}
    found = {}
    for row in units[1]:
        kind, place = kinds.get(int(row["FmtType"])), row["UnitIds"].find(b"#")
        if kind is not None and 0 <= place < len(kind.letters):
            found[kind.name] = list(kind.letters)[place]
    return found


def _split(
    name: str, rows: npt.NDArray[np.void], field: str | None
) -> dict[str, npt.NDArray[np.void] | None]:
    """Return the tables of the instances of a kind."""
    if field is None or rows.dtype[field].kind not in "iu":
        return {name: rows}
    return {
        f"{name}#{one}" if one else name: rows[rows[field] == one]
        for one in np.unique(rows[field]).tolist()
    }


def _epoch(rows: npt.NDArray[Any] | None) -> int | None:
    """Return the time at which the vehicle's clock was 0, ns, by GPS, if it had the date."""
    if rows is None or not {TIME, "GWk", "GMS"} <= set(rows.dtype.names or ()):
        return None
    dated = rows[(rows["GWk"] > 0) & (rows["GWk"] < LAST_WEEK) & (rows[TIME] < WEEK * 10**9)]
    if not len(dated):
        return None
    first = dated[0]
    seconds = GPS_EPOCH - LEAP + WEEK * int(first["GWk"])
    return seconds * 10**9 + int(first["GMS"]) * 10**6 - int(first[TIME]) * 1000


def _texts(rows: npt.NDArray[Any] | None) -> list[tuple[float, int, str]]:
    if rows is None or not {TIME, "Message"} <= set(rows.dtype.names or ()):
        return []
    return [
        (1e-6 * int(row[TIME]), INFO, bytes(row["Message"]).decode("utf-8", "replace"))
        for row in rows
    ]
