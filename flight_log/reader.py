"""Messages, attachments and metadata of a log, finished or not."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.records import Attachment, Channel, Metadata, Schema

from flight_log.limits import Kept
from flight_log.records import RawMessage, ReadState, records


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
    """Messages in the order they were written, up to the tear if the file has one.

    Args:
        topics: only these; None for all.
        state: told afterwards whether the file was closed and where it is torn.

    Raises LogFormatError or StorageError.
    """
    schemas: dict[int, str] = {}
    channels: dict[int, tuple[str, str]] = {}
    for record in records(path, state):
        if isinstance(record, RawMessage):
            # Unknown: the topic is not wanted, or stood in a damaged chunk.
            if channel := channels.get(record.channel_id):
                yield LogMessage(
                    *channel, record.payload, record.log_ns, record.publish_ns, record.sequence
                )
        elif isinstance(record, Schema):
            schemas[record.id] = record.name
        elif isinstance(record, Channel) and (topics is None or record.topic in topics):
            channels[record.id] = (record.topic, schemas.get(record.schema_id, ""))


def read_attachments(path: Path) -> dict[str, bytes]:
    """Name → bytes of those before the first message, where LogWriter puts them.

    Those are left out that are too large to be kept (`flight_log.limits`).

    Raises LogFormatError or StorageError.
    """
    found: dict[str, bytes] = {}
    kept = Kept(path.name)
    for record in records(path):
        if isinstance(record, Attachment):
            if not kept.has_room(len(record.data)):
                continue
            kept.add(record.name, len(record.data))
            found[record.name] = record.data
        elif isinstance(record, RawMessage):
            break
    return found


def read_metadata(path: Path) -> dict[str, dict[str, str]]:
    """Every metadata record of the file (`quadlab.run`, `quadlab.recovered`), whole file read.

    Raises LogFormatError or StorageError.
    """
    return {r.name: dict(r.metadata) for r in records(path) if isinstance(r, Metadata)}
