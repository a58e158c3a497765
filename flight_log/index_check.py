"""Whether the index at a log's end can be used, and what it repeats of the log."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from flight_log.file import open_log
from flight_log.limits import MOST_DESCRIPTION
from flight_log.walk import RECORD
from quadrotor.errors import StorageError

NO_END = "has no end mark: its writer was killed, or it was copied in part"
DAMAGED = "has a damaged index"
_FOOTER = struct.Struct("<BQQQI")  # opcode, length, place of the index, of its offsets, checksum
_END = _FOOTER.size + len(MCAP0_MAGIC)
_CHECKSUM = 4
_PIECE = 1 << 20


def index_problem(path: Path) -> str:
    """What is wrong with it; nothing when it is sound, or the log was closed without one.

    Raises StorageError.
    """
    with open_log(path) as stream:
        try:
            return _problem(stream.fileno())
        except OSError as error:
            raise StorageError(f"cannot read {path}: {error.strerror}") from error


def index_names(path: Path) -> Iterator[tuple[int, bytes]]:
    """Opcode and content of the schemas and channels that a sound index begins with.

    Raises StorageError.
    """
    if index_problem(path):
        return
    with open_log(path) as stream:
        file = stream.fileno()
        end = os.fstat(file).st_size - _END
        place = _footer(file)[2] or end
        while place + RECORD.size <= end:
            opcode, length = RECORD.unpack(os.pread(file, RECORD.size, place))
            if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL) or length > MOST_DESCRIPTION:
                return
            yield opcode, os.pread(file, length, place + RECORD.size)
            place += RECORD.size + length


def _footer(file: int) -> tuple[int, ...]:
    size = os.fstat(file).st_size
    return _FOOTER.unpack(os.pread(file, _FOOTER.size, size - _END))


def _problem(file: int) -> str:
    size = os.fstat(file).st_size
    magic = len(MCAP0_MAGIC)
    if size < magic + _END or os.pread(file, magic, size - magic) != MCAP0_MAGIC:
        return NO_END
    opcode, length, begin, _, checksum = _footer(file)
    if opcode != Opcode.FOOTER or length != _FOOTER.size - RECORD.size:
        return f"{DAMAGED}: it has no footer"
    if begin == 0:
        return ""
    end = size - magic - _CHECKSUM
    if not magic <= begin <= size - _END:
        return f"{DAMAGED}: it is said to begin at byte {begin} of {size}"
    found = 0
    for place in range(begin, end if checksum else begin, _PIECE):
        found = zlib.crc32(os.pread(file, min(_PIECE, end - place), place), found)
    return "" if found == checksum else f"{DAMAGED}: its checksum is wrong"
