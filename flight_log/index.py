"""The index at a log's end: whether it is usable, its records, and the log's times.

A flight of 20 minutes has 30 000 chunks, and a hostile log may have millions: only the wanted
groups of the index are read, in pieces, through a function, so that a log on another machine is
read in the same way.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcap.opcode import Opcode

from flight_log.file import open_log
from flight_log.format import END_BYTES, FOOTER, MAGIC, RECORD, SUMMARY_OFFSET, UNREADABLE, parsed
from flight_log.limits import MAX_DESCRIPTION
from quadrotor.errors import LogFormatError

NO_END = "has no end mark: its writer was killed, or it was copied in part"
DAMAGED = "has a damaged index"
RECOVERED_METADATA = "quadlab.recovered"
_STRIDE = 1 << 20
_MAX_OFFSETS = 256 * (RECORD.size + SUMMARY_OFFSET.size)

Read = Callable[[int, int], bytes]
"""Function from place and length to that many bytes."""


def reading(file: int) -> Read:
    """Return a reader of an open file's descriptor."""
    return lambda place, length: os.pread(file, length, place)


def is_closed(path: Path) -> bool:
    """Return True when the file has its end mark. Raises StorageError."""
    with open_log(path) as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(max(size - len(MAGIC), 0))
        return size >= 2 * len(MAGIC) and stream.read() == MAGIC


def holds_nothing(path: Path) -> bool:
    """Return whether its writer was killed before the first record. Raises StorageError."""
    with open_log(path) as stream:
        return MAGIC.startswith(stream.read(len(MAGIC) + 1))


def begins_as_log(file: int) -> bool:
    """Return whether an open file begins like a log. Raises OSError."""
    return os.pread(file, len(MAGIC), 0) == MAGIC


def index_problem(path: Path) -> str:
    """Return what is wrong with the index; "" when it is sound, or the log was closed without one.

    Raises StorageError.
    """
    with open_log(path) as stream:
        return _problem(reading(stream.fileno()), os.fstat(stream.fileno()).st_size)


def _problem(read: Read, size: int) -> str:
    if size < len(MAGIC) + END_BYTES or read(size - len(MAGIC), len(MAGIC)) != MAGIC:
        return NO_END
    try:
        begin, _, checksum = _footer(read, size)
    except UNREADABLE as error:
        return f"{DAMAGED}: {error}"
    if begin == 0:
        return ""
    end = size - len(MAGIC) - 4  # the checksum itself
    if not len(MAGIC) <= begin <= size - END_BYTES:
        return f"{DAMAGED}: its index says that it begins at byte {begin} of {size}"
    found = 0
    for place in range(begin, end if checksum else begin, _STRIDE):
        found = zlib.crc32(read(place, min(_STRIDE, end - place)), found)
    return "" if found == checksum else f"{DAMAGED}: its checksum is wrong"


def _footer(read: Read, size: int) -> tuple[int, int, int]:
    data = read(max(size - END_BYTES, 0), END_BYTES)
    opcode, length = RECORD.unpack_from(data)
    if opcode != Opcode.FOOTER or length != FOOTER.size or not data.endswith(MAGIC):
        raise ValueError("it has no footer")
    begin, offsets, checksum = FOOTER.unpack_from(data, RECORD.size)
    return begin, offsets, checksum


def index_records(read: Read, size: int, wanted: Collection[int]) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of the `wanted` records; none if the log has no index.

    Raises one of UNREADABLE for an index that is not sound or holds too large a record, and any
    exception of `read`.
    """
    begin, offsets, _ = _footer(read, size)
    if not begin:
        return
    last = size - END_BYTES
    end = offsets if begin <= offsets <= last else last
    for start, stop in _groups(read, wanted, offsets, last) or [(begin, end)]:
        if not begin <= start <= stop <= end:
            raise ValueError("a group outside of the index")
        yield from _between(read, start, stop, wanted)


def _groups(read: Read, wanted: Collection[int], offsets: int, end: int) -> list[tuple[int, int]]:
    """Return where the wanted groups are, if the index has their offsets."""
    step = RECORD.size + SUMMARY_OFFSET.size
    if not 0 < offsets < end or end - offsets > _MAX_OFFSETS:
        return []
    data = read(offsets, (end - offsets) // step * step)
    found = []
    for place in range(0, len(data), step):
        if data[place] != Opcode.SUMMARY_OFFSET:
            return []
        group, start, length = SUMMARY_OFFSET.unpack_from(data, place + RECORD.size)
        if group in wanted:
            found.append((start, start + length))
    return sorted(set(found))


def _between(
    read: Read, place: int, end: int, wanted: Collection[int]
) -> Iterator[tuple[int, bytes]]:
    piece, at = b"", place
    while place + RECORD.size <= end:
        if place + RECORD.size > at + len(piece):
            piece, at = read(place, min(_STRIDE, end - place)), place
        opcode, length = RECORD.unpack_from(piece, place - at)
        place += RECORD.size
        if length > end - place:
            raise ValueError("a record longer than the index")
        if opcode in wanted:
            if length > MAX_DESCRIPTION:
                raise ValueError(f"a record of {length} bytes")
            here = piece[place - at : place - at + length]
            yield opcode, here if len(here) == length else read(place, length)
        place += length


def index_names(path: Path) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of the schemas and channels of a sound index. Raises
    StorageError.
    """
    if index_problem(path):
        return
    with open_log(path) as stream, suppress(*UNREADABLE):
        file = stream.fileno()
        wanted = (Opcode.SCHEMA, Opcode.CHANNEL)
        yield from index_records(reading(file), os.fstat(file).st_size, wanted)


@dataclass(frozen=True, slots=True)
class FileIndex:
    """The times of a log from its index: reception (log time), ns; 0 without messages."""

    start_ns: int
    end_ns: int
    recovered: bool


def read_index(path: Path) -> FileIndex:
    """Read a file's times from its index, in a tenth of a millisecond.

    Raises LogFormatError when there is no index, or StorageError.
    """
    wanted = (Opcode.STATISTICS, Opcode.METADATA_INDEX)
    records: dict[int, list[Any]] = {opcode: [] for opcode in wanted}
    try:
        with open_log(path) as stream:
            file = stream.fileno()
            for opcode, data in index_records(reading(file), os.fstat(file).st_size, wanted):
                records[opcode].append(parsed(opcode, data))
        [statistics] = records[Opcode.STATISTICS]
    except UNREADABLE as error:
        raise LogFormatError(f"{path.name} has no index that can be read") from error
    recovered = RECOVERED_METADATA in [one.name for one in records[Opcode.METADATA_INDEX]]
    return FileIndex(statistics.message_start_time, statistics.message_end_time, recovered)
