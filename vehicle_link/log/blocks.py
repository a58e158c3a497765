"""A log in large blocks, so that numpy works on thousands of messages at once.

Chunks are opened one after the other and their message indexes say where each channel's messages
stand. A chunk whose index is missing (the last one of a torn file, another writer's) is walked
record by record. Nothing is held beyond one block.
"""

from __future__ import annotations

import struct
import zlib
from collections import defaultdict
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import IO, Any, NamedTuple

import lz4.frame
import numpy as np
import numpy.typing as npt
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from quadrotor.errors import LogFormatError, StorageError

BLOCK_BYTES = 4_000_000
HEAD_BYTES = 31
"""Of a message record before its payload: opcode, length, channel, sequence, two times."""
_RECORD = struct.Struct("<BQ")
_INDEX = struct.Struct("<HI")
_CHANNEL = struct.Struct("<H")

Bytes = npt.NDArray[np.uint8]
Places = npt.NDArray[np.int64]


class Block(NamedTuple):
    """Some chunks, opened."""

    data: Bytes
    places: dict[int, Places]  # channel id → where its message records begin in `data`, in order
    share: float  # of the file read so far, 0 to 1


class BlockReader:
    """Iterate once; `channels`, `schemas`, `attachments` and `metadata` grow on the way.

    After the last block `tear` says why reading stopped early (empty: at the log's end) and
    `damaged_chunks` how many were passed over.

    Raises:
        LogFormatError: this is no MCAP file, or it is compressed in a way not read here.
        StorageError: the file cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.attachments: dict[str, bytes] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.tear = ""
        self.damaged_chunks = 0
        self._parts: list[bytes] = []
        self._filled = 0
        self._places: dict[int, list[Places]] = defaultdict(list)
        self._chunk = b""  # whose indexes are being read
        self._entries: dict[int, bytes] = {}

    def __iter__(self) -> Iterator[Block]:
        try:
            size = self.path.stat().st_size
            stream = self.path.open("rb")
        except OSError as error:
            raise StorageError(f"cannot read {self.path}: {error.strerror}") from error
        with stream:
            start = stream.read(len(MCAP0_MAGIC))
            if not start:
                raise LogFormatError(f"{self.path.name} is empty: nothing was recorded")
            if start != MCAP0_MAGIC:
                raise LogFormatError(f"{self.path.name} is no MCAP log (wrong first bytes)")
            for opcode, data in self._records(stream, size):
                self._take(opcode, data)
                if self._filled >= BLOCK_BYTES:
                    yield self._block(stream.tell() / size)
            self._close_chunk(is_indexed=not self.tear)
            if self._filled:
                yield self._block(1.0)

    def _records(self, stream: IO[bytes], size: int) -> Iterator[tuple[int, bytes]]:
        """Opcode and content up to the data's end, or the tear."""
        while True:
            begin = stream.tell()
            head = stream.read(_RECORD.size)
            if len(head) == _RECORD.size:
                opcode, length = _RECORD.unpack(head)
                if opcode == Opcode.DATA_END:
                    return
                if opcode > 0 and begin + _RECORD.size + length <= size:
                    yield opcode, stream.read(length)
                    continue
            self.tear = f"ends within a record after byte {begin} of {size}"
            return

    def _take(self, opcode: int, data: bytes) -> None:
        if opcode == Opcode.MESSAGE_INDEX:
            channel, length = _INDEX.unpack_from(data)
            if length:
                self._entries[channel] = data[_INDEX.size : _INDEX.size + length]
            return
        self._close_chunk(is_indexed=True)
        if opcode == Opcode.CHUNK:
            self._chunk = self._opened(data)
        elif opcode == Opcode.MESSAGE:
            self._add(_RECORD.pack(opcode, len(data)) + data, None)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._learn(opcode, data)
        elif opcode == Opcode.ATTACHMENT:
            attachment = Attachment.read(_stream(data))
            self.attachments[attachment.name] = attachment.data
        elif opcode == Opcode.METADATA:
            record = Metadata.read(_stream(data))
            self.metadata[record.name] = dict(record.metadata)

    def _opened(self, data: bytes) -> bytes:
        """What is in a chunk; nothing when it is damaged: the next one may be whole again."""
        try:
            chunk = Chunk.read(_stream(data))
            if chunk.compression not in ("", "lz4"):
                raise LogFormatError(
                    f"{self.path.name}: chunks are compressed with {chunk.compression!r}; allowed "
                    "are lz4 and none: convert with `mcap compress --compression lz4`"
                )
            content = lz4.frame.decompress(chunk.data) if chunk.compression else chunk.data
            if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
                raise ValueError("checksum")
        except (RuntimeError, ValueError, struct.error, UnicodeDecodeError):
            self.damaged_chunks += 1
            return b""
        return bytes(content)

    def _close_chunk(self, *, is_indexed: bool) -> None:
        """The chunk read last joins the block; `is_indexed`: all of its indexes were read."""
        chunk, entries = self._chunk, self._entries
        self._chunk, self._entries = b"", {}
        if chunk:
            self._add(chunk, entries if is_indexed and entries else None)

    def _add(self, data: bytes, entries: dict[int, bytes] | None) -> None:
        """`entries`: pairs of log time and place, by channel; None when not known."""
        base = self._filled
        if entries is None or not entries.keys() <= self.channels.keys():
            found = self._walk(data)
        else:
            found = {
                channel: np.frombuffer(pairs, "<u8").reshape(-1, 2)[:, 1].astype(np.int64)
                for channel, pairs in entries.items()
            }
        for channel, places in found.items():
            inside = places[(places >= 0) & (places <= len(data) - HEAD_BYTES)]
            self._places[channel].append(np.sort(inside) + base)
        self._parts.append(data)
        self._filled += len(data)

    def _walk(self, data: bytes) -> dict[int, Places]:
        """Every record of a chunk, as far as it is whole; new schemas and channels are kept."""
        found: dict[int, list[int]] = defaultdict(list)
        position = 0
        while position + _RECORD.size <= len(data):
            opcode, length = _RECORD.unpack_from(data, position)
            begin, end = position + _RECORD.size, position + _RECORD.size + length
            if end > len(data):
                self.damaged_chunks += 1
                break
            if opcode == Opcode.MESSAGE and length >= HEAD_BYTES - _RECORD.size:
                found[_CHANNEL.unpack_from(data, begin)[0]].append(position)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._learn(opcode, data[begin:end])
            position = end
        return {channel: np.array(places, np.int64) for channel, places in found.items()}

    def _learn(self, opcode: int, data: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(_stream(data))
            self.schemas[schema.id] = schema
        else:
            channel = Channel.read(_stream(data))
            self.channels[channel.id] = channel

    def _block(self, share: float) -> Block:
        data = np.frombuffer(b"".join(self._parts), np.uint8)
        places = {channel: np.concatenate(parts) for channel, parts in self._places.items()}
        self._parts, self._filled = [], 0
        self._places = defaultdict(list)
        return Block(data, places, share)


def field_at(data: Bytes, places: Places, offset: int, dtype: str) -> npt.NDArray[Any]:
    """A number that stands `offset` bytes behind each place, shape (N,)."""
    kind = np.dtype(dtype)
    if len(places) == 0:
        return np.zeros(0, kind)
    stands: npt.NDArray[Any] = np.ndarray(
        (len(data) - kind.itemsize + 1,), kind, data.data, strides=(1,)
    )
    return stands[places + offset]


def _stream(data: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(data))
