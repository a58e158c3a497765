"""The records of a log one after the other, as far as it is intact, and those in its chunks.

The log of a killed writer may end anywhere. Readers that seek refuse such a file; this walk goes up
to the tear and reports where and why it stopped. It holds one record at a time.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Metadata, Schema

from flight_log.file import open_log
from flight_log.format import MAGIC, MESSAGE, RECORD, TIMES, UNREADABLE, opened, parsed
from flight_log.index import index_names
from flight_log.limits import MemoryBudget, check_record, map_bytes
from quadrotor.errors import LogFormatError

AT_ONCE = 1_000_000
"""Largest size, in bytes, of a chunk whose messages are made together."""
MAX_DAMAGED = 1000
"""Largest number of skipped records that are reported one by one."""


_KEPT = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.ATTACHMENT, Opcode.METADATA)


class RawMessage(NamedTuple):
    """One message of a channel, as it is in the file."""

    channel_id: int
    sequence: int
    log_ns: int
    publish_ns: int
    payload: bytes


LogRecord = Header | Attachment | Metadata | Schema | Channel | RawMessage


class Damaged(NamedTuple):
    """A record that was skipped."""

    is_chunk: bool
    place: int  # byte at which it begins
    size: int  # bytes
    times_ns: tuple[int, int]  # of a chunk: reception of its first and last message, as it claims


@dataclass
class WalkState:
    """Progress and result of `walk`; final when it has ended."""

    closed: bool = False  # it has its index and end mark, and nothing after them
    whole_bytes: int = 0  # up to the end of the last intact record
    share: float = 0.0  # of the file read so far, 0 to 1
    tear: str = ""  # why reading stopped, empty for a closed file


def walk(path: Path, state: WalkState, begin: int = 0) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of every record up to the footer or the tear.

    Args:
        begin: offset of the first record read; 0 for all.

    Raises:
        LogFormatError: this is not an MCAP file, or a record is too large.
        StorageError: the file cannot be read.
    """
    with open_log(path) as stream:
        yield from _walk(path.name, stream, state, begin)


def _walk(
    name: str, stream: IO[bytes], state: WalkState, begin: int
) -> Iterator[tuple[int, bytes]]:
    size = os.fstat(stream.fileno()).st_size
    start = stream.read(len(MAGIC))
    if not start:
        raise LogFormatError(f"{name} is empty: nothing was recorded")
    if not MAGIC.startswith(start):
        raise LogFormatError(f"{name} is not an MCAP log (wrong first bytes)")
    place, state.whole_bytes = len(MAGIC), begin
    if begin:
        place = stream.seek(begin)
    read, unpack, head_bytes, footer = stream.read, RECORD.unpack, RECORD.size, int(Opcode.FOOTER)
    while True:
        head = read(head_bytes)
        opcode, length = unpack(head) if len(head) == head_bytes else (0, 0)
        end = place + head_bytes + length
        if opcode == 0 or end > size:
            break
        check_record(name, length, place)
        data = read(length)
        if len(data) < length:
            break
        place = state.whole_bytes = end
        state.share = place / size
        held = [data]
        del data  # so that only the reader holds it, and it is freed before the next one
        yield opcode, held.pop()
        if opcode == footer:
            behind = stream.read(len(MAGIC))
            more = size - place - len(behind)
            if more and stream.read(len(MAGIC)) == MAGIC:
                raise LogFormatError(
                    f"{name} is two logs one after the other: the second begins at byte "
                    f"{place + len(MAGIC)}; split the file there"
                )
            if behind != MAGIC:
                state.tear = "has a wrong end mark"
            elif more:
                state.tear = f"has {more} bytes after its end"
            else:
                state.closed = True
            return
    if state.whole_bytes == 0:
        raise LogFormatError(f"{name} ends before its first record; there is nothing to recover")
    within = "within a record" if place < size else "without its end mark"
    state.tear = f"ends {within} after byte {place} of {size}"


@dataclass
class ReadState(WalkState):
    """Progress and result of `records`; final when it has ended."""

    damaged_chunks: int = 0  # skipped, because their checksum was wrong
    damaged_records: int = 0  # skipped: attachments, metadata and such
    damaged: list[Damaged] = field(default_factory=list)  # both, in the order of the file


def records(path: Path, state: ReadState | None = None) -> Iterator[LogRecord]:
    """Yield every record before the index of the file, with chunks decompressed.

    Raises:
        LogFormatError: this is not an MCAP file, or it is of an unsupported kind.
        StorageError: the file cannot be read.
    """
    state = state if state is not None else ReadState()
    in_index = is_helped = False
    budget = MemoryBudget(path.name)
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
        except UNREADABLE:  # the next one may be intact
            state.damaged_chunks += opcode == Opcode.CHUNK
            state.damaged_records += opcode != Opcode.CHUNK
            if len(state.damaged) < MAX_DAMAGED:
                state.damaged.append(_damaged(opcode, data, state.whole_bytes))
            # Each schema and channel occurs once before the index, possibly in this chunk.
            names = [] if is_helped else index_names(path)
            found = [one for name in names for one in _one(*name)]
            is_helped = True
        del data  # free it while its messages are handled
        for record in found:
            if not isinstance(record, RawMessage):
                _count(record, budget)
            yield record
        found = []


def _damaged(opcode: int, data: bytes, end: int) -> Damaged:
    """Return the damaged record; `end` is its end, in bytes of the file."""
    is_chunk = opcode == Opcode.CHUNK
    times = TIMES.unpack_from(data) if is_chunk and len(data) >= TIMES.size else (0, 0)
    size = RECORD.size + len(data)
    return Damaged(is_chunk, end - size, size, times)


def split_chunk(data: bytes) -> Iterable[LogRecord]:
    """Return the records of a decompressed chunk, all readable. Raises one of UNREADABLE."""
    if len(data) <= AT_ONCE:
        return list(_split(data))
    for _ in _split(data):  # a message takes many times its bytes: one at a time
        pass
    return _split(data)


def _split(data: bytes) -> Iterator[LogRecord]:
    """Split a chunk; the library's own splitting takes 8 µs a message, this takes 1."""
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


def _count(record: LogRecord, budget: MemoryBudget) -> None:
    """Count what readers hold. Raises LogFormatError when it is too much."""
    match record:
        case Schema():
            budget.add((Opcode.SCHEMA, record.id), len(record.data))
        case Channel():
            budget.add((Opcode.CHANNEL, record.id), len(record.topic) + map_bytes(record.metadata))
        case Metadata():
            budget.add((Opcode.METADATA, record.name), map_bytes(record.metadata))


def _one(opcode: int, data: bytes) -> Iterator[LogRecord]:
    """Yield a record outside of chunks; nothing for one of the index."""
    if opcode == Opcode.MESSAGE:
        yield _message(data, 0, len(data))
    elif opcode in _KEPT:
        yield parsed(opcode, data)


def _message(data: bytes, begin: int, end: int) -> RawMessage:
    """Return the message of a record. Raises ValueError when it is shorter than its head."""
    if end - begin < MESSAGE.size:
        raise ValueError("message shorter than its head")
    channel, sequence, log_ns, publish_ns = MESSAGE.unpack_from(data, begin)
    return RawMessage(channel, sequence, log_ns, publish_ns, data[begin + MESSAGE.size : end])
