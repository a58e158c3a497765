"""The records of a log one after the other, as far as it is whole.

A log whose writer was killed ends anywhere. Seeking readers refuse such a file; this walk goes up
to the tear and says where and why it stopped. It holds one record at a time.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import IO

from lz4.frame import LZ4FrameDecompressor
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment
from mcap.writer import MCAP0_MAGIC

from flight_log.file import open_log
from flight_log.limits import check_chunk, check_record
from quadrotor.errors import LogFormatError, StorageError

RECORD = struct.Struct("<BQ")
"""Opcode and length before each record's content."""
_CHUNK = struct.Struct("<QQQII")  # first and last time, size, checksum, length of the name
_STORED = struct.Struct("<Q")
UNREADABLE = (
    McapError,
    RuntimeError,
    ValueError,
    struct.error,
    IndexError,
    OverflowError,
    MemoryError,
)
"""What the library and lz4 raise for bytes that are no such record."""


@dataclass
class WalkState:
    """Filled while `walk` runs; final when it ended."""

    closed: bool = False  # the index and the end mark were there, and nothing behind
    whole_bytes: int = 0  # up to the end of the last whole record
    share: float = 0.0  # of the file read so far, 0 to 1
    tear: str = ""  # why reading stopped, empty for a closed file


def walk(path: Path, state: WalkState) -> Iterator[tuple[int, bytes]]:
    """Opcode and content of every record up to the footer or the tear.

    Raises:
        LogFormatError: this is no MCAP file, or a record is larger than any that is read.
        StorageError: the file cannot be read.
    """
    with open_log(path) as stream:
        try:
            yield from _walk(path.name, stream, state)
        except OSError as error:
            raise StorageError(f"cannot read {path}: {error.strerror}") from error


def _walk(name: str, stream: IO[bytes], state: WalkState) -> Iterator[tuple[int, bytes]]:
    size = os.fstat(stream.fileno()).st_size
    start = stream.read(len(MCAP0_MAGIC))
    if not start:
        raise LogFormatError(f"{name} is empty: nothing was recorded")
    if not MCAP0_MAGIC.startswith(start):
        raise LogFormatError(f"{name} is no MCAP log (wrong first bytes)")
    place = len(MCAP0_MAGIC)
    while True:
        head = stream.read(RECORD.size)
        opcode, length = RECORD.unpack(head) if len(head) == RECORD.size else (0, 0)
        end = place + RECORD.size + length
        if opcode and end <= size:
            check_record(name, length, place)
        data = stream.read(length) if opcode and end <= size else b""
        if opcode == 0 or len(data) < length or end > size:
            break
        place = state.whole_bytes = end
        state.share = place / size
        held = [data]
        del data  # so that it is the reader's alone, and gone before the next one comes
        yield opcode, held.pop()
        if opcode == Opcode.FOOTER:
            behind = stream.read(len(MCAP0_MAGIC))
            more = size - place - len(behind)
            if more and stream.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC:
                raise LogFormatError(
                    f"{name} is two logs one behind the other: the second begins at byte "
                    f"{place + len(MCAP0_MAGIC)}; part them there"
                )
            if behind != MCAP0_MAGIC:
                state.tear = "has a wrong end mark"
            elif more:
                state.tear = f"has {more} bytes behind its end"
            else:
                state.closed = True
            return
    if state.whole_bytes == 0:
        raise LogFormatError(f"{name} ends before its first record; there is nothing to recover")
    within = "within a record" if place < size else "without its end mark"
    state.tear = f"ends {within} after byte {place} of {size}"


def opened(name: str, content: bytes) -> bytes:
    """Return what is in a chunk record, opened as far as it says it goes and no further.

    Raises LogFormatError when it is too large or compressed in a way not read here, one of
    UNREADABLE when it is damaged.
    """
    view = memoryview(content)
    _, _, size, checksum, length = _CHUNK.unpack_from(view)
    place = _CHUNK.size + length
    compression = str(view[_CHUNK.size : place], "utf-8")
    if compression not in ("", "lz4"):
        raise LogFormatError(
            f"{name}: chunks are compressed with {compression!r:.40}; allowed are lz4 and "
            "none: convert with `mcap compress --compression lz4`"
        )
    stored = view[place + _STORED.size :]
    if _STORED.unpack_from(view, place)[0] != len(stored):
        raise ValueError("size")
    check_chunk(name, len(stored), size)
    if compression:
        data: bytes = LZ4FrameDecompressor().decompress(stored, max_length=size + 1)
    else:
        data = bytes(stored)
    if len(data) != size:
        raise ValueError("size")
    if checksum and zlib.crc32(data) != checksum:
        raise ValueError("checksum")
    return data


def attachment_of(content: bytes) -> Attachment:
    """Raises one of UNREADABLE when it is damaged."""
    found: Attachment = Attachment.read(stream_of(content))
    checksum = int.from_bytes(content[-4:], "little")
    if checksum and zlib.crc32(memoryview(content)[:-4]) != checksum:
        raise ValueError("checksum")
    return found


def stream_of(data: bytes) -> ReadDataStream:
    """For the library's readers of single records."""
    return ReadDataStream(BytesIO(data))
