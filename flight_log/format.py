"""The records of an MCAP file as stored in its bytes, each declared once (https://mcap.dev/spec).

A record is its opcode, the length of its content, and the content. The library's classes read and
write the rare ones; those that occur by the thousand are packed and unpacked here.
"""

from __future__ import annotations

import struct
import zlib
from functools import cache
from io import BytesIO
from typing import Any

import numpy as np
from lz4.frame import create_decompression_context, decompress_chunk
from mcap import records as library
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from flight_log.limits import MAX_DESCRIPTION, check_chunk
from quadrotor.errors import LogFormatError

MAGIC: bytes = MCAP0_MAGIC
"""First and last bytes of a log."""
RECORD = struct.Struct("<BQ")
"""Opcode and length, before each record's content."""
MESSAGE = struct.Struct("<HIQQ")
"""Channel, sequence, log time, publish time; then the payload."""
HEAD_BYTES = RECORD.size + MESSAGE.size
"""Bytes of a message record before its payload."""
_MESSAGE_FIELDS = [
    ("opcode", "u1"),
    ("length", "<u8"),
    ("channel", "<u2"),
    ("sequence", "<u4"),
    ("log_ns", "<u8"),
    ("publish_ns", "<u8"),
]
LENGTH_AT, CHANNEL_AT, LOG_AT, PUBLISH_AT = 1, 9, 15, 23
"""Offsets in a message record of its length, its channel and its two times."""
CHUNK = struct.Struct("<QQQII")
"""First and last log time, decompressed size, checksum, length of the compression's name."""
TIMES = struct.Struct("<QQ")
"""The first two fields of CHUNK."""
LENGTH = struct.Struct("<Q")
MESSAGE_INDEX = struct.Struct("<HI")
"""Channel, bytes of its entries."""
INDEX_ENTRY = struct.Struct("<QQ")
"""Log time, offset in the decompressed chunk."""
CHUNK_INDEX = struct.Struct("<QQQQI")
"""First and last log time, offset, length, bytes of the map of message indexes."""
INDEX_PLACE = struct.Struct("<HQ")
"""An entry of that map: channel, offset of its index."""
FOOTER = struct.Struct("<QQI")
"""Offset of the index, offset of its offsets, checksum."""
SUMMARY_OFFSET = struct.Struct("<BQQ")
"""Opcode of a group of the index, its offset, its length."""
END_BYTES = RECORD.size + FOOTER.size + len(MAGIC)
"""Bytes of the footer and the end mark."""

UNREADABLE = (
    McapError,
    RuntimeError,
    ValueError,
    struct.error,
    IndexError,
    OverflowError,
    MemoryError,
)
"""Exceptions that the library and lz4 raise for bytes that are no such record."""

DESCRIPTIONS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA)
_CLASSES: dict[int, Any] = {
    Opcode.HEADER: library.Header,
    Opcode.SCHEMA: library.Schema,
    Opcode.CHANNEL: library.Channel,
    Opcode.ATTACHMENT: library.Attachment,
    Opcode.METADATA: library.Metadata,
    Opcode.STATISTICS: library.Statistics,
    Opcode.ATTACHMENT_INDEX: library.AttachmentIndex,
    Opcode.METADATA_INDEX: library.MetadataIndex,
}


@cache
def message_record(size: int) -> np.dtype:
    """Return a message record with a payload of `size` bytes as a numpy type."""
    return np.dtype([*_MESSAGE_FIELDS, ("payload", f"V{size}")])


def parsed(opcode: int, content: bytes) -> Any:
    """Return a record as the library's class. Raises one of UNREADABLE when it is damaged."""
    if opcode in DESCRIPTIONS and len(content) > MAX_DESCRIPTION:
        raise ValueError("too large")
    found = _CLASSES[opcode].read(ReadDataStream(BytesIO(content)))
    if opcode == Opcode.ATTACHMENT:
        checksum = int.from_bytes(content[-4:], "little")
        if checksum and zlib.crc32(memoryview(content)[:-4]) != checksum:
            raise ValueError("checksum")
    return found


def opened(name: str, content: bytes) -> bytes:
    """Return the decompressed content of a chunk record, up to the size that it claims.

    Raises LogFormatError when it is too large or its compression is not supported, one of
    UNREADABLE when it is damaged.
    """
    view = memoryview(content)
    _, _, size, checksum, length = CHUNK.unpack_from(view)
    place = CHUNK.size + length
    compression = str(view[CHUNK.size : place], "utf-8")
    if compression not in ("", "lz4", "zstd"):
        raise LogFormatError(
            f"{name}: chunks are compressed with {compression!r:.40}; allowed are lz4, zstd and "
            "none: convert with `mcap compress --compression lz4`"
        )
    stored = view[place + LENGTH.size :]
    if LENGTH.unpack_from(view, place)[0] != len(stored):
        raise ValueError("size")
    check_chunk(name, compression, len(stored), size)
    if compression == "lz4":
        context = create_decompression_context()
        data: bytes = decompress_chunk(context, stored, max_length=size + 1)[0]
    elif compression == "zstd":
        data = _unpacked_zstd(stored, size)
    else:
        data = bytes(stored)
    if len(data) != size:
        raise ValueError("size")
    if checksum and zlib.crc32(data) != checksum:
        raise ValueError("checksum")
    return data


def _unpacked_zstd(stored: memoryview, size: int) -> bytes:
    """Return at most `size` + 1 bytes. Raises ValueError when it is damaged."""
    from zstandard import ZstdDecompressor, ZstdError

    try:
        return ZstdDecompressor().stream_reader(stored).read(size + 1)
    except ZstdError as error:
        raise ValueError(str(error)) from error
