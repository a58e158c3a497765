"""Everything in a log before its index, chunks opened, in the order of the file."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Metadata, Schema

from flight_log.index_check import index_names
from flight_log.limits import MOST_DESCRIPTION, Kept, map_bytes
from flight_log.walk import RECORD, UNREADABLE, WalkState, attachment_of, opened, stream_of, walk

_MESSAGE = struct.Struct("<HIQQ")
_TIMES = struct.Struct("<QQ")
AT_ONCE = 1_000_000
"""Bytes of a chunk whose messages are made together."""
MOST_DAMAGED = 1000
"""Records passed over that are told one by one."""


class RawMessage(NamedTuple):
    """One message of a channel, as it stands in the file."""

    channel_id: int
    sequence: int
    log_ns: int
    publish_ns: int
    payload: bytes


LogRecord = Header | Attachment | Metadata | Schema | Channel | RawMessage


class Damaged(NamedTuple):
    """A record that was passed over."""

    is_chunk: bool
    place: int  # byte it begins at
    size: int  # bytes
    times_ns: tuple[int, int]  # of a chunk: reception of its first and last message, as it says


@dataclass
class ReadState(WalkState):
    """Filled while `records` runs; final when it ended."""

    damaged_chunks: int = 0  # passed over, because their checksum was wrong
    damaged_records: int = 0  # passed over: attachments, metadata and such
    damaged: list[Damaged] = field(default_factory=list)  # both, in the order of the file


def records(path: Path, state: ReadState | None = None) -> Iterator[LogRecord]:
    """Everything before the index of the file, chunks opened.

    Raises:
        LogFormatError: this is no MCAP file, or of a kind not read here.
        StorageError: the file cannot be read.
    """
    state = state if state is not None else ReadState()
    in_index = is_helped = False
    kept = Kept(path.name)
    for opcode, data in walk(path, state):
        in_index = in_index or opcode == Opcode.DATA_END
        if in_index:
            continue
        found: Iterable[LogRecord]
        try:
            if opcode == Opcode.CHUNK:
                found = split_chunk(opened(path.name, data))
            else:
                found = list(_one(opcode, data))
        except UNREADABLE:  # the next one may be whole again
            state.damaged_chunks += opcode == Opcode.CHUNK
            state.damaged_records += opcode != Opcode.CHUNK
            if len(state.damaged) < MOST_DAMAGED:
                state.damaged.append(_damaged(opcode, data, state.whole_bytes))
            # Each schema and channel stands once before the index; it may have been here.
            names = [] if is_helped else index_names(path)
            found = [one for name in names for one in _one(*name)]
            is_helped = True
        del data  # while its messages are looked at
        for record in found:
            if not isinstance(record, RawMessage):
                _count(record, kept)
            yield record
        found = []


def _damaged(opcode: int, data: bytes, end: int) -> Damaged:
    """`end`: of the record, in bytes of the file."""
    is_chunk = opcode == Opcode.CHUNK
    times = _TIMES.unpack_from(data) if is_chunk and len(data) >= _TIMES.size else (0, 0)
    size = RECORD.size + len(data)
    return Damaged(is_chunk, end - size, size, times)


def split_chunk(data: bytes) -> Iterable[LogRecord]:
    """Return the records of an opened chunk; all can be read. Raise one of UNREADABLE."""
    if len(data) <= AT_ONCE:
        return list(_split(data))
    for _ in _split(data):  # a message takes many times its bytes: one at a time
        pass
    return _split(data)


def _split(data: bytes) -> Iterator[LogRecord]:
    """The library's own splitting takes 8 µs a message; this takes 1."""
    position, end = 0, len(data)
    while position < end:
        opcode, length = RECORD.unpack_from(data, position)
        position += RECORD.size
        following = position + length
        if following > end:
            raise ValueError("record longer than its chunk")
        if opcode == Opcode.MESSAGE:
            yield _message(data, position, following)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            yield from _one(opcode, data[position:following])
        position = following


def _count(record: LogRecord, kept: Kept) -> None:
    """Count what readers keep. Raise LogFormatError when it is too much."""
    match record:
        case Schema():
            kept.add((Opcode.SCHEMA, record.id), len(record.data))
        case Channel():
            kept.add((Opcode.CHANNEL, record.id), len(record.topic) + map_bytes(record.metadata))
        case Metadata():
            kept.add((Opcode.METADATA, record.name), map_bytes(record.metadata))


def _one(opcode: int, data: bytes) -> Iterator[LogRecord]:
    """A record by itself; nothing for one of the index."""
    if opcode == Opcode.MESSAGE:
        yield _message(data, 0, len(data))
        return
    if opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA) and len(data) > MOST_DESCRIPTION:
        raise ValueError("too large")
    if opcode == Opcode.SCHEMA:
        yield Schema.read(stream_of(data))
    elif opcode == Opcode.CHANNEL:
        yield Channel.read(stream_of(data))
    elif opcode == Opcode.ATTACHMENT:
        yield attachment_of(data)
    elif opcode == Opcode.METADATA:
        yield Metadata.read(stream_of(data))
    elif opcode == Opcode.HEADER:
        yield Header.read(stream_of(data))


def _message(data: bytes, begin: int, end: int) -> RawMessage:
    """Raises ValueError when there is no room for its head."""
    if end - begin < _MESSAGE.size:
        raise ValueError("message shorter than its head")
    channel, sequence, log_ns, publish_ns = _MESSAGE.unpack_from(data, begin)
    return RawMessage(channel, sequence, log_ns, publish_ns, data[begin + _MESSAGE.size : end])
