"""The index at a log's end, record by record, without what it says of single chunks.

A flight of 20 minutes has 30 000 chunks, and whoever makes a log may write millions: what is asked
of the whole log alone is read past them.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Collection, Iterator

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from flight_log.limits import MOST_DESCRIPTION

_RECORD = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI")  # opcode, length, place of the index, of its offsets, checksum
_OFFSET = struct.Struct("<BQBQQ")  # opcode, length, group, start, length of the group
_END = _FOOTER.size + len(MCAP0_MAGIC)
_STRIDE = 1 << 20
_MOST_OFFSETS = 256 * _OFFSET.size


def index_records(file: int, wanted: Collection[int]) -> Iterator[tuple[int, bytes]]:
    """Opcode and content of those records; nothing when the log was closed without an index.

    Args:
        file: descriptor of a log whose index is sound.

    Raises ValueError or struct.error for one that is not, or holds too large a record; OSError.
    """
    size = os.fstat(file).st_size
    footer = os.pread(file, _FOOTER.size, max(size - _END, 0))
    opcode, _, begin, offsets, _ = _FOOTER.unpack(footer)
    if opcode != Opcode.FOOTER or begin > size - _END:
        raise ValueError("no footer")
    if not begin:
        return
    end = offsets if begin <= offsets <= size - _END else size - _END
    for start, stop in _groups(file, wanted, offsets, size - _END) or [(begin, end)]:
        if not begin <= start <= stop <= end:
            raise ValueError("a group outside of the index")
        yield from _between(file, start, stop, wanted)


def _groups(file: int, wanted: Collection[int], offsets: int, end: int) -> list[tuple[int, int]]:
    """Return where the wanted ones stand, if the index has them."""
    if not 0 < offsets < end or end - offsets > _MOST_OFFSETS:
        return []
    told = os.pread(file, (end - offsets) // _OFFSET.size * _OFFSET.size, offsets)
    found = []
    for opcode, _, group, start, length in _OFFSET.iter_unpack(told):
        if opcode != Opcode.SUMMARY_OFFSET:
            return []
        if group in wanted:
            found.append((start, start + length))
    return sorted(set(found))


def _between(
    file: int, place: int, end: int, wanted: Collection[int]
) -> Iterator[tuple[int, bytes]]:
    piece, at = b"", place
    while place + _RECORD.size <= end:
        if not at <= place <= at + len(piece) - _RECORD.size:
            piece, at = os.pread(file, _STRIDE, place), place
        opcode, length = _RECORD.unpack_from(piece, place - at)
        place += _RECORD.size
        if length > end - place:
            raise ValueError("a record longer than the index")
        if opcode in wanted:
            if length > MOST_DESCRIPTION:
                raise ValueError(f"a record of {length} bytes")
            yield opcode, os.pread(file, length, place)
        place += length
