"""A log in large blocks, so that numpy works on thousands of messages at once.

Chunks are opened one after the other, and their message indexes give the positions of each
channel's messages. A chunk whose index is missing (the last one of a torn file, or another
writer's) is walked record by record. Only one block is held at a time, or one chunk if that is
larger; it is yielded in several blocks, as its messages may take many times its bytes as columns.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema

from flight_log.format import (
    CHANNEL_AT,
    CHUNK,
    HEAD_BYTES,
    INDEX_ENTRY,
    LENGTH_AT,
    MESSAGE_INDEX,
    RECORD,
    UNREADABLE,
    opened,
    parsed,
)
from flight_log.index import index_names
from flight_log.limits import MemoryBudget, map_bytes
from flight_log.records import WalkState, records, walk

BLOCK_BYTES = 4_000_000
_INDEX, _CHUNK, _MESSAGE = map(int, (Opcode.MESSAGE_INDEX, Opcode.CHUNK, Opcode.MESSAGE))
"""The most frequent, as numbers: to look up a member takes longer than to compare it."""

Bytes = npt.NDArray[np.uint8]
Places = npt.NDArray[np.int64]


class Block(NamedTuple):
    """Some chunks, decompressed, or a part of a large one."""

    data: Bytes
    places: dict[int, Places]  # channel id → offsets of its message records in `data`, in order
    share: float  # of the file read so far, 0 to 1


class BlockReader:
    """Iterator over a log's blocks, to be used once; `channels`, `schemas`, `attachments` and
    `metadata` fill up on the way.

    Args:
        begin: offset of the first record read, whose channels the caller knows; 0 for all.
        block_bytes: size of a block.

    After the last block `tear` gives the reason why reading stopped early (empty: at the log's
    end), `damaged_chunks` and `damaged_records` how many were skipped.

    Raises:
        LogFormatError: this is not an MCAP file, or its compression is not supported.
        StorageError: the file cannot be read.
    """

    def __init__(self, path: Path, begin: int = 0, block_bytes: int = BLOCK_BYTES) -> None:
        self.path, self._name = path, path.name
        self._begin, self._block_bytes = begin, block_bytes
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.attachments: dict[str, bytes] = {}
        self.attachment_bytes: dict[str, int] = {}  # of all, also of those too large to keep
        self.metadata: dict[str, dict[str, str]] = {}
        self.tear = ""
        self.damaged_chunks = self.damaged_records = 0
        self._parts: list[bytes] = []
        self._indexes: list[list[bytes]] = []  # of each part; none where they are not known
        self._filled = 0
        self._described: set[int] = set()
        self._chunk = b""  # whose indexes are being read
        self._its: list[bytes] = []
        self._its_bytes = 0
        self._loose: list[bytes] = []  # messages outside of chunks
        self._loose_bytes = 0
        self._is_searched = False
        self._budget = MemoryBudget(path.name)

    def __iter__(self) -> Iterator[Block]:
        state = WalkState()
        for opcode, data in walk(self.path, state, self._begin):
            if opcode == _INDEX:
                self.damaged_records += len(data) < MESSAGE_INDEX.size
                if len(data) > MESSAGE_INDEX.size:
                    self._its_bytes += len(data)
                    if self._its_bytes <= len(self._chunk):
                        self._its.append(data)
                continue
            if opcode == Opcode.DATA_END:
                break
            if opcode == _CHUNK and _claimed(data) > BLOCK_BYTES:
                self._close_chunk(is_indexed=True)
                yield from self._blocks(state.share)  # so that the large chunk is not copied
            self._take(opcode, data)
            del data
            if self._filled >= self._block_bytes:
                yield from self._blocks(state.share)
        self.tear = state.tear
        self._close_chunk(is_indexed=not self.tear)
        yield from self._blocks(1.0)

    def _take(self, opcode: int, data: bytes) -> None:
        try:
            if opcode != _MESSAGE:
                self._close_chunk(is_indexed=True)
            if opcode == _CHUNK:
                self._chunk = opened(self._name, data)
            elif opcode == _MESSAGE:
                self._loose.append(RECORD.pack(opcode, len(data)) + data)
                self._loose_bytes += RECORD.size + len(data)
                if self._loose_bytes >= BLOCK_BYTES:
                    self._close_chunk(is_indexed=True)
            elif opcode == Opcode.ATTACHMENT:
                attachment = parsed(opcode, data)
                self.attachment_bytes[attachment.name] = len(attachment.data)
                if self._budget.has_room(len(attachment.data)):
                    self._budget.add((opcode, attachment.name), len(attachment.data))
                    self.attachments[attachment.name] = attachment.data
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA):
                self._learn(opcode, data)
        except UNREADABLE:  # the next one may be intact
            self.damaged_chunks += opcode == Opcode.CHUNK
            self.damaged_records += opcode != Opcode.CHUNK

    def _close_chunk(self, *, is_indexed: bool) -> None:
        """Add the last chunk to the block, or the messages after it that are in no chunk;
        `is_indexed` tells whether all of the chunk's indexes were read.
        """
        chunk, its = self._chunk, self._its
        is_indexed = is_indexed and self._its_bytes <= len(chunk)
        self._chunk, self._its, self._its_bytes = b"", [], 0
        if chunk:
            self._add(chunk, its if is_indexed else [])
        if self._loose:
            loose, self._loose, self._loose_bytes = self._loose, [], 0
            self._add(b"".join(loose), [])

    def _add(self, part: bytes, indexes: list[bytes]) -> None:
        self._parts.append(part)
        self._indexes.append(indexes)
        self._filled += len(part)

    def _describe(self, channels: Collection[int]) -> None:
        """Find the descriptions of these channels where they may be: in a chunk without their
        messages, which was not walked, or in a damaged one."""
        if not all(map(self._is_described, channels)):
            for name in index_names(self.path):
                self._learn(*name)
        if not self._is_searched and not all(map(self._is_described, channels)):
            self._is_searched = True  # every description in the file is known then
            for record in records(self.path):
                if isinstance(record, Schema):
                    self.schemas.setdefault(record.id, record)
                elif isinstance(record, Channel):
                    self.channels.setdefault(record.id, record)
        self._described.update(channels)  # as far as possible; not searched again

    def _is_described(self, channel_id: int) -> bool:
        channel = self.channels.get(channel_id)
        return channel is not None and channel.schema_id in (0, *self.schemas)

    def _walk(self, data: bytes) -> list[bytes]:
        """Return the indexes that a chunk should have, for its messages as far as it is intact;
        store new schemas and channels.
        """
        found: dict[int, bytearray] = defaultdict(bytearray)
        position = 0
        while position + RECORD.size <= len(data):
            opcode, length = RECORD.unpack_from(data, position)
            begin, end = position + RECORD.size, position + RECORD.size + length
            if end > len(data):
                self.damaged_chunks += 1
                break
            if opcode == Opcode.MESSAGE and length >= HEAD_BYTES - RECORD.size:
                channel = int.from_bytes(data[begin : begin + 2], "little")
                found[channel] += INDEX_ENTRY.pack(0, position)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._learn(opcode, data[begin:end])
            position = end
        return [MESSAGE_INDEX.pack(one, len(pairs)) + pairs for one, pairs in found.items()]

    def _learn(self, opcode: int, data: bytes) -> None:
        try:
            record = parsed(opcode, data)
        except UNREADABLE:
            self.damaged_records += 1
            return
        match record:
            case Schema() as schema:
                self._budget.add((opcode, schema.id), len(data))
                self.schemas[schema.id] = schema
            case Channel() as channel:
                self._budget.add((opcode, channel.id), len(data) + map_bytes(channel.metadata))
                self.channels[channel.id] = channel
            case Metadata() as record:
                self._budget.add((opcode, record.name), map_bytes(record.metadata))
                self.metadata[record.name] = dict(record.metadata)

    def _blocks(self, share: float) -> Iterator[Block]:
        """Yield what was collected, in pieces of about BLOCK_BYTES."""
        if not self._filled:
            return
        parts, given = self._parts, self._indexes
        self._parts, self._indexes, self._filled = [], [], 0
        data = np.frombuffer(b"".join(parts), np.uint8)
        indexes = [its or self._walk(part) for part, its in zip(parts, given, strict=True)]
        places = _places(parts, indexes)
        is_known = bool(self._begin) or places.keys() <= self.channels.keys()
        if not (is_known and _are_messages(data, places)):  # declared in here, or a wrong index
            both = zip(parts, given, indexes, strict=True)
            indexes = [self._walk(part) if its else walked for part, its, walked in both]
            places = _places(parts, indexes)
        if not self._begin and not places.keys() <= self._described:
            self._describe(places.keys())
        del parts
        if len(data) < 2 * BLOCK_BYTES:
            yield Block(data, places, share)
            return
        for begin in range(0, len(data), BLOCK_BYTES):
            inside = {}
            for channel, its in places.items():
                first, last = np.searchsorted(its, (begin, begin + BLOCK_BYTES))
                if last > first:
                    inside[channel] = its[first:last]
            if inside:
                yield Block(data, inside, share)


def _claimed(chunk: bytes) -> int:
    """Return the decompressed size that a chunk claims, in bytes; 0 for none."""
    return int(CHUNK.unpack_from(chunk)[2]) if len(chunk) >= CHUNK.size else 0


def _places(parts: Sequence[bytes], indexes: Sequence[Sequence[bytes]]) -> dict[int, Places]:
    """Return the possible offsets of each channel's messages in a block.

    Args:
        parts: chunks of the block.
        indexes: contents of the message index records of each.
    """
    merged = [one for its in indexes for one in its]
    sizes = np.array([len(one) for one in merged], np.int64)
    data = np.frombuffer(b"".join(merged), np.uint8)
    begins = np.cumsum(sizes) - sizes
    channels = field_at(data, begins, 0, "<u2")
    claimed = np.minimum(field_at(data, begins, 2, "<u4"), sizes - MESSAGE_INDEX.size)
    counts = claimed.astype(np.int64) // INDEX_ENTRY.size
    lengths = np.array([len(part) for part in parts], np.int64)
    owners = np.repeat(np.arange(len(parts)), [len(its) for its in indexes])
    firsts = begins + MESSAGE_INDEX.size - INDEX_ENTRY.size * (np.cumsum(counts) - counts)
    entries = np.repeat(firsts, counts) + INDEX_ENTRY.size * np.arange(counts.sum())
    places = field_at(data, entries, 8, "<i8")
    inside = (places >= 0) & (places <= np.repeat(lengths[owners], counts) - HEAD_BYTES)
    places = places + np.repeat((np.cumsum(lengths) - lengths)[owners], counts)
    channel = np.repeat(channels, counts)
    return {
        one: np.sort(places[inside & (channel == one)]) for one in dict.fromkeys(channels.tolist())
    }


def _are_messages(data: Bytes, places: Mapping[int, Places]) -> bool:
    """Return whether a message of its channel begins at each offset, and no two overlap."""
    for channel, its in places.items():
        of_channel = field_at(data, its, CHANNEL_AT, "<u2") == channel
        if not (of_channel & (data[its] == Opcode.MESSAGE)).all():
            return False
    every = np.sort(np.concatenate([*places.values(), np.zeros(0, np.int64)]))
    lengths = field_at(data, every, LENGTH_AT, "<u8")
    if (lengths > len(data)).any():
        return False
    ends = every + RECORD.size + lengths.astype(np.int64)
    return bool((ends[:-1] <= every[1:]).all())


def field_at(data: Bytes, places: Places, offset: int, dtype: str) -> npt.NDArray[Any]:
    """Return the number that is `offset` bytes after each place, shape (N,)."""
    kind = np.dtype(dtype)
    if len(places) == 0:
        return np.zeros(0, kind)
    stands: npt.NDArray[np.generic] = np.ndarray(
        (len(data) - kind.itemsize + 1,), kind, data.data, strides=(1,)
    )
    return stands[places + offset]


def rows_at(data: Bytes, places: Places, size: int) -> Bytes:
    """Return the bytes from each place on, shape (N, size)."""
    if size == 0:
        return np.zeros((len(places), 0), np.uint8)
    rows: Bytes = field_at(data, places, 0, f"V{size}").view(np.uint8).reshape(len(places), size)
    return rows
