"""A summary of the contents of a log, from its index where possible."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, Metadata, MetadataIndex, Schema, Statistics

from flight_log.blocks import BlockReader, field_at
from flight_log.file import open_log
from flight_log.format import LOG_AT, RECORD, UNREADABLE, parsed
from flight_log.index import (
    DAMAGED,
    NO_END,
    RECOVERED_METADATA,
    Read,
    index_problem,
    index_records,
    reading,
)
from flight_log.limits import MAX_DESCRIPTION, MemoryBudget, map_bytes
from flight_log.run_folder import log_of
from flight_log.writer import FILLED_METADATA, RUN_METADATA
from quadrotor.errors import LogFormatError


@dataclass(frozen=True, slots=True)
class TopicSummary:
    """One topic of a log."""

    type_name: str
    count: int


@dataclass(frozen=True, slots=True)
class LogSummary:
    """The contents of a log."""

    path: Path
    bytes: int
    closed: bool  # has its index
    recovered: bool
    tear: str  # why it ends early, empty when closed
    start_ns: int  # reception of the first message
    duration: float  # s
    topics: dict[str, TopicSummary] = field(default_factory=dict)
    attachments: dict[str, int] = field(default_factory=dict)  # name → bytes
    run: dict[str, str] = field(default_factory=dict)  # `quadlab.run`
    filled: dict[str, str] = field(default_factory=dict)  # `quadlab.filled`

    @property
    def message_count(self) -> int:
        return sum(topic.count for topic in self.topics.values())


def summarize(path: Path, progress: Callable[[float], None] = lambda share: None) -> LogSummary:
    """Summarise a closed file from its index, another by reading it, up to its tear if it has one.

    Args:
        progress: called with the share read, 0…1, if the file must be read.

    Raises LogFormatError or StorageError.
    """
    problem = index_problem(path)
    if problem == NO_END:
        return _by_reading(path, problem, progress)
    try:
        if problem:
            raise ValueError(problem)
        with open_log(path) as stream:
            found = _by_index(path, stream.fileno())
    except (*UNREADABLE, KeyError) as error:
        why = problem or f"{DAMAGED} ({error!r:.80})"
        raise LogFormatError(f"{path} {why}; try: quadlab log recover") from error
    return found or _by_reading(path, problem, progress)


_WANTED = (
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.STATISTICS,
    Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
)


def _by_index(path: Path, file: int) -> LogSummary | None:
    """Return the summary from the index; None when the log was closed without one."""
    schemas: dict[int, str] = {0: ""}
    channels: dict[int, Channel] = {}
    attachments: dict[str, int] = {}
    metadata: dict[str, dict[str, str]] = {}
    statistics: Statistics | None = None
    budget, read, size = MemoryBudget(path.name), reading(file), os.fstat(file).st_size
    for opcode, data in index_records(read, size, _WANTED):
        match parsed(opcode, data):
            case Schema() as schema:
                schemas[schema.id] = schema.name
            case Channel() as channel:
                budget.add(channel.id, len(data) + map_bytes(channel.metadata))
                channels[channel.id] = channel
            case Statistics() as found:
                statistics = found
            case AttachmentIndex() as index:
                budget.add(("attachment", index.name), len(index.name))
                attachments[index.name] = index.data_size
            case MetadataIndex() as index:
                with suppress(*UNREADABLE):  # a damaged one
                    record = _metadata(read, index)
                    budget.add(("metadata", index.name), map_bytes(record.metadata))
                    metadata[record.name] = dict(record.metadata)
    if statistics is None:
        return None
    described = {one.id: (one.topic, schemas[one.schema_id]) for one in channels.values()}
    span = statistics.message_start_time, statistics.message_end_time
    counts = statistics.channel_message_counts
    return _summary(
        path,
        size,
        tear="",
        span=span,
        described=described,
        counts=counts,
        attachments=attachments,
        metadata=metadata,
    )


def _summary(
    path: Path,
    size: int,
    tear: str,
    span: tuple[int, int],
    described: Mapping[int, tuple[str, str]],
    counts: Mapping[int, int],
    attachments: dict[str, int],
    metadata: Mapping[str, dict[str, str]],
) -> LogSummary:
    """Return the summary of what was found; `described` has topic and type of each channel."""
    topics: dict[str, TopicSummary] = {}
    for channel_id, (topic, type_name) in described.items():
        before = topics[topic].count if topic in topics else 0
        topics[topic] = TopicSummary(type_name, before + counts.get(channel_id, 0))
    first, last = span
    return LogSummary(
        path=path,
        bytes=size,
        closed=not tear,
        recovered=RECOVERED_METADATA in metadata,
        tear=tear,
        start_ns=first,
        duration=(last - first) * 1e-9,
        topics=topics,
        attachments=attachments,
        run=metadata.get(RUN_METADATA, {}),
        filled=metadata.get(FILLED_METADATA, {}),
    )


def _metadata(read: Read, index: MetadataIndex) -> Metadata:
    """Read a metadata record. Raises one of UNREADABLE."""
    opcode, length = RECORD.unpack(read(index.offset, RECORD.size))
    if opcode != Opcode.METADATA or length > MAX_DESCRIPTION:
        raise ValueError("no metadata")
    found: Metadata = parsed(opcode, read(index.offset + RECORD.size, length))
    return found


def _by_reading(path: Path, problem: str, progress: Callable[[float], None]) -> LogSummary:
    """Read block by block, as a chunk may hold millions of messages; `problem` is the index's."""
    reader = BlockReader(path)
    counts: Counter[int] = Counter()
    first, last = 2**64 - 1, 0
    for block in reader:
        for channel_id, places in block.places.items():
            received = field_at(block.data, places, LOG_AT, "<u8")
            first = min(first, int(received.min(initial=first)))
            last = max(last, int(received.max(initial=last)))
            counts[channel_id] += len(places)
        progress(block.share)
    described: dict[int, tuple[str, str]] = {}
    for channel_id in counts:
        if (channel := reader.channels.get(channel_id)) is not None:
            schema = reader.schemas.get(channel.schema_id)
            described[channel_id] = (channel.topic, schema.name if schema else "")
    size, span = log_of(path).stat().st_size, (min(first, last), last)
    return _summary(
        path,
        size,
        reader.tear or problem,
        span,
        described,
        counts,
        attachments=reader.attachment_bytes,
        metadata=reader.metadata,
    )
