"""Logs of the Crazyflie's µSD card, with a table for each kind of event; `timestamp` in ms.

The file begins with byte 0xBC, version and number of kinds (uint16 each); for every kind its id,
its name, how many numbers it has and the name of each with its letter of `struct` in brackets,
names ended by 0. The events follow: id, time (ms as uint32, or µs as uint64 from version 2 on),
numbers. The last 4 bytes are a CRC-32 of everything before.
"""

from __future__ import annotations

import struct
from array import array
from collections import defaultdict
from collections.abc import Collection
from mmap import ACCESS_READ, MADV_DONTNEED, mmap
from pathlib import Path
from zlib import crc32

import numpy as np

from extensions.importers.readers.tables import FileTables
from extensions.importers.rows import blocks
from flight_log.blocks import field_at
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

MAGIC = b"\xbc"
LETTERS = {**{one: f"<{one}" for one in "bBhHiIqQfd"}, "l": "<i", "L": "<I"}
VERSIONS = {1: "<u4", 2: "<u8"}
"""Type of an event's time, by version."""
TIME = "timestamp"


class CrazyflieTables(FileTables):
    """The tables of the kinds of events that were written at least once."""

    def __init__(self, path: Path, _: Collection[str] = ()) -> None:
        """Read the log. Raises LogFormatError."""
        super().__init__(path)
        with path.open("rb") as file:
            self._data = data = mmap(file.fileno(), 0, access=ACCESS_READ)
        try:
            kinds, start, self._unit = _kinds(data)
        except (IndexError, ValueError, KeyError, UnicodeDecodeError, struct.error) as error:
            raise LogFormatError(
                f"{path.name} is not a log of a Crazyflie: {error!s:.80}"
            ) from None
        whole = len(data) > 9 and crc32(memoryview(data)[:-4]) == int.from_bytes(
            data[-4:], "little"
        )
        end = len(data) - 4 if whole else len(data)
        places: dict[int, array[int]] = defaultdict(lambda: array("q"))
        sizes = {number: kind.itemsize for number, (_, kind) in kinds.items()}
        at = start
        while at < end:
            number = int.from_bytes(data[at : at + 2], "little")
            size = sizes.get(number, 0)
            if not size or at + size > end:
                break
            places[number].append(at)
            at += size
        if not whole:
            self.torn = f"its checksum is wrong; events are read up to byte {at} of {len(data)}"
        elif at < end:
            self.torn = f"there is no event at byte {at} of {len(data)}"
        self._kinds = {kinds[number][0]: kinds[number][1] for number in places}
        self._places = {
            kinds[number][0]: np.frombuffer(found, np.int64) for number, found in places.items()
        }

    def tables(self) -> list[str]:
        return list(self._kinds)

    def columns(self, table: str) -> list[str]:
        return [name for name in self._kinds[table].names or () if name != "id"]

    def read(self, table: str, names: list[str]) -> Array:
        places, fields = self._places[table], self._kinds[table].fields
        assert fields is not None
        data = np.frombuffer(self._data, np.uint8)
        found = np.empty((len(places), len(names)))
        for some in blocks(found):
            for k, name in enumerate(names):
                kind, offset = fields[name][:2]
                found[some, k] = field_at(data, places[some], offset, kind.str)
            self._data.madvise(MADV_DONTNEED)  # pages of the file that were read count as memory
        if TIME in names:
            found[:, names.index(TIME)] *= self._unit
        return found


def _kinds(data: mmap) -> tuple[dict[int, tuple[str, np.dtype[np.void]]], int, float]:
    """Return name and record of each kind of event, the first event's offset, the time unit, ms."""
    version, count = struct.unpack_from("<HH", data, 1)
    time, at = VERSIONS[version], 5
    found: dict[int, tuple[str, np.dtype[np.void]]] = {}
    for _ in range(count):
        (number,) = struct.unpack_from("<H", data, at)
        name, at = _text(data, at + 2)
        (items,) = struct.unpack_from("<H", data, at)
        at += 2
        fields = [("id", "<u2"), (TIME, time)]
        for _ in range(items):
            field, at = _text(data, at)
            fields.append((field[:-3], LETTERS[field[-2]]))
        found[number] = (name, np.dtype(fields))
    return found, at, 1.0 if version == 1 else 1e-3


def _text(data: mmap, at: int) -> tuple[str, int]:
    if (end := data.find(b"\0", at)) < 0:
        raise ValueError("a name without an end")
    return data[at:end].decode(), end + 1
