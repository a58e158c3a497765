"""The messages of one topic of a closed log, found by its index: only the chunks with them are
opened."""

from __future__ import annotations

import os
import struct
from collections.abc import Collection, Iterator
from itertools import chain
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Channel

from flight_log.file import open_log
from flight_log.index_records import index_records
from flight_log.limits import check_record
from flight_log.reader import read_log
from flight_log.records import RawMessage, split_chunk
from flight_log.walk import RECORD, UNREADABLE, opened, stream_of
from quadrotor.errors import LogFormatError, StorageError

_CHUNK = struct.Struct("<QQQQI")  # first and last log time, place, length, bytes of a map
_ENTRY = struct.Struct("<HQ")  # of the map: channel, place of its index


def read_topic(path: Path, name: str) -> Iterator[bytes]:
    """Payloads in CDR of `/<vehicle>/<name>` of any vehicle, in the order they were written.

    Raises LogFormatError or StorageError; a log without the topic has none.
    """
    try:
        with open_log(path) as stream:
            file = stream.fileno()
            wanted = {
                channel.id
                for _, data in index_records(file, {Opcode.CHANNEL})
                if (channel := Channel.read(stream_of(data))).topic.endswith(f"/{name}")
            }
            if not wanted:
                return
            chunks = index_records(file, {Opcode.CHUNK_INDEX})
            if (first := next(chunks, None)) is None:  # its messages stand outside of chunks
                yield from (m.payload for m in read_log(path) if m.topic.endswith(f"/{name}"))
                return
            for _, data in chain([first], chunks):
                if (place := _chunk_with(data, wanted)) is not None:
                    yield from _payloads(path.name, file, place, wanted)
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}") from error
    except UNREADABLE as error:
        raise LogFormatError(
            f"{path} has a damaged index ({error}); try: quadlab log recover"
        ) from error


def _chunk_with(index: bytes, wanted: Collection[int]) -> int | None:
    """Its place if the chunk has messages of these channels, or does not tell."""
    _, _, place, _, length = _CHUNK.unpack_from(index)
    channels = {
        channel for channel, _ in _ENTRY.iter_unpack(index[_CHUNK.size : _CHUNK.size + length])
    }
    return int(place) if not channels or channels & set(wanted) else None


def _payloads(name: str, file: int, place: int, wanted: Collection[int]) -> Iterator[bytes]:
    opcode, length = RECORD.unpack(os.pread(file, RECORD.size, place))
    check_record(name, length, place)
    if opcode != Opcode.CHUNK:
        raise ValueError(f"no chunk at byte {place}")
    for record in split_chunk(opened(name, os.pread(file, length, place + RECORD.size))):
        if isinstance(record, RawMessage) and record.channel_id in wanted:
            yield record.payload
