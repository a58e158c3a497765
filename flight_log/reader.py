"""Messages, attachments and metadata of a log, finished or not."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from functools import cache
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema

from flight_log.file import open_log
from flight_log.format import CHUNK_INDEX, INDEX_PLACE, RECORD, UNREADABLE, opened, parsed
from flight_log.index import index_records, reading
from flight_log.limits import MemoryBudget, check_record
from flight_log.records import RawMessage, ReadState, records, split_chunk
from quadrotor.errors import LogFormatError, UsageError
from vehicle_link.messages import stored_name, typestore


class LogMessage(NamedTuple):
    """One message as it was recorded."""

    topic: str
    type_name: str
    payload: bytes  # CDR
    log_ns: int  # reception at the writer
    publish_ns: int  # the source's stamp
    sequence: int


def read_log(
    path: Path, topics: Collection[str] | None = None, state: ReadState | None = None
) -> Iterator[LogMessage]:
    """Yield messages in the order in which they were written, up to the tear if the file has one.

    Args:
        topics: only these; None for all.
        state: filled with whether the file was closed and where it is torn.

    Raises LogFormatError or StorageError.
    """
    schemas: dict[int, str] = {}
    channels: dict[int, tuple[str, str]] = {}
    for record in records(path, state):
        if isinstance(record, RawMessage):
            # Unknown: the topic is not wanted, or was in a damaged chunk.
            if channel := channels.get(record.channel_id):
                yield LogMessage(
                    *channel, record.payload, record.log_ns, record.publish_ns, record.sequence
                )
        elif isinstance(record, Schema):
            schemas[record.id] = decodable_name(record)
        elif isinstance(record, Channel) and (topics is None or record.topic in topics):
            channels[record.id] = (record.topic, schemas.get(record.schema_id, ""))


def read_attachments(path: Path) -> dict[str, bytes]:
    """Return name → bytes of the attachments before the first message, where LogWriter puts them.

    Attachments that are too large (`flight_log.limits`) are left out.

    Raises LogFormatError or StorageError.
    """
    found: dict[str, bytes] = {}
    budget = MemoryBudget(path.name)
    for record in records(path):
        if isinstance(record, Attachment):
            if not budget.has_room(len(record.data)):
                continue
            budget.add(record.name, len(record.data))
            found[record.name] = record.data
        elif isinstance(record, RawMessage):
            break
    return found


def read_metadata(path: Path) -> dict[str, dict[str, str]]:
    """Return every metadata record (`quadlab.run`, `quadlab.recovered`); reads the whole file.

    Raises LogFormatError or StorageError.
    """
    return {r.name: dict(r.metadata) for r in records(path) if isinstance(r, Metadata)}


def read_topic(path: Path, name: str) -> Iterator[bytes]:
    """Yield the CDR payloads of `/<vehicle>/<name>` of any vehicle, in the order of the file.

    In a closed log only the chunks that contain them are decompressed.

    Raises LogFormatError or StorageError; yields nothing for a log without the topic.
    """
    try:
        with open_log(path) as stream:
            file, size = stream.fileno(), os.fstat(stream.fileno()).st_size
            wanted = {
                channel.id
                for _, data in index_records(reading(file), size, {Opcode.CHANNEL})
                if (channel := parsed(Opcode.CHANNEL, data)).topic.endswith(f"/{name}")
            }
            if not wanted:
                return
            chunks = index_records(reading(file), size, {Opcode.CHUNK_INDEX})
            if (first := next(chunks, None)) is None:  # its messages are outside of chunks
                yield from (m.payload for m in read_log(path) if m.topic.endswith(f"/{name}"))
                return
            for _, data in chain([first], chunks):
                if (place := _chunk_with(data, wanted)) is not None:
                    yield from _payloads(path.name, file, place, wanted)
    except UNREADABLE as error:
        raise LogFormatError(
            f"{path} has a damaged index ({error}); try: quadlab log recover"
        ) from error


def _chunk_with(index: bytes, wanted: Collection[int]) -> int | None:
    """Return the chunk's offset if it has, or may have, messages of these channels, else None."""
    _, _, place, _, length = CHUNK_INDEX.unpack_from(index)
    channels = {
        channel
        for channel, _ in INDEX_PLACE.iter_unpack(
            index[CHUNK_INDEX.size : CHUNK_INDEX.size + length]
        )
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


def decodable_name(schema: Schema) -> str:
    """Return the type name with which `decode` reads the messages of this schema.

    It is the schema's own name unless the fields differ from those of this version.
    """
    return _decodable_name(schema.name, schema.data)


@cache
def _decodable_name(name: str, described: bytes) -> str:
    from rosbags.typesys import get_types_from_msg  # late: it takes a while
    from rosbags.typesys.base import TypesysError

    try:
        own = stored_name(name)
        found = get_types_from_msg(described.decode(), own)
    except (TypesysError, UsageError, ValueError):
        return name
    store = typestore()
    ours = store.fielddefs
    if own not in ours or list(found[own][1]) == list(ours[own][1]):
        return name
    other = f"{own}Version{sum(one.startswith(f'{own}Version') for one in ours)}"
    parts = {part: fields for part, fields in found.items() if part not in ours}
    store.register({**parts, other: found[own]})
    return other
