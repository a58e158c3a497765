"""What a log holds, without reading its messages where the index tells."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from mcap.reader import McapReader, make_reader
from mcap.records import Attachment, Metadata

from quadrotor.errors import LogFormatError, StorageError
from vehicle_link.log.file import open_log
from vehicle_link.log.index_check import DAMAGED, NO_END, index_problem
from vehicle_link.log.reader import read_log
from vehicle_link.log.records import RawMessage, ReadState, records
from vehicle_link.log.recovery import RECOVERED_METADATA
from vehicle_link.log.walk import UNREADABLE
from vehicle_link.log.writer import FILLED_METADATA, RUN_METADATA


@dataclass(frozen=True, slots=True)
class TopicSummary:
    """One topic of a log."""

    type_name: str
    count: int


@dataclass(frozen=True, slots=True)
class LogSummary:
    """Contents of a log."""

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


def summarize(path: Path) -> LogSummary:
    """Of a closed file from its index, of a torn one by reading it up to the tear.

    Raises LogFormatError or StorageError.
    """
    problem = index_problem(path)
    if problem == NO_END:
        return _by_reading(path)
    try:
        if problem:
            raise ValueError(problem)
        with open_log(path) as stream:
            return _by_index(path, make_reader(stream))
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}") from error
    except (*UNREADABLE, KeyError) as error:
        why = problem or f"{DAMAGED} ({error!r:.80})"
        raise LogFormatError(f"{path} {why}; try: quadlab log recover") from error


def _by_index(path: Path, reader: McapReader) -> LogSummary:
    index = reader.get_summary()
    if index is None or index.statistics is None:
        return _by_reading(path)
    statistics = index.statistics
    topics: dict[str, TopicSummary] = {}
    for channel in index.channels.values():
        count = statistics.channel_message_counts.get(channel.id, 0)
        name = index.schemas[channel.schema_id].name if channel.schema_id else ""
        before = topics[channel.topic].count if channel.topic in topics else 0
        topics[channel.topic] = TopicSummary(name, before + count)
    metadata: dict[str, dict[str, str]] = {}
    with suppress(*UNREADABLE):  # a damaged one
        metadata.update((m.name, dict(m.metadata)) for m in reader.iter_metadata())
    return LogSummary(
        path=path,
        bytes=path.stat().st_size,
        closed=True,
        recovered=RECOVERED_METADATA in metadata,
        tear="",
        start_ns=statistics.message_start_time,
        duration=(statistics.message_end_time - statistics.message_start_time) * 1e-9,
        topics=topics,
        attachments={a.name: a.data_size for a in index.attachment_indexes},
        run=metadata.get(RUN_METADATA, {}),
        filled=metadata.get(FILLED_METADATA, {}),
    )


def _by_reading(path: Path) -> LogSummary:
    state = ReadState()
    counts: dict[str, tuple[str, int]] = {}
    first = last = 0
    for message in read_log(path, state=state):
        first = min(first or message.log_ns, message.log_ns)
        last = max(last, message.log_ns)
        counts[message.topic] = (message.type_name, counts.get(message.topic, ("", 0))[1] + 1)
    attachments: dict[str, int] = {}
    metadata: dict[str, dict[str, str]] = {}
    for record in records(path):
        if isinstance(record, Attachment):
            attachments[record.name] = len(record.data)
        elif isinstance(record, Metadata):
            metadata[record.name] = dict(record.metadata)
        elif isinstance(record, RawMessage):
            break
    return LogSummary(
        path=path,
        bytes=path.stat().st_size,
        closed=state.closed,
        recovered=RECOVERED_METADATA in metadata,
        tear=state.tear,
        start_ns=first,
        duration=(last - first) * 1e-9,
        topics={topic: TopicSummary(name, count) for topic, (name, count) in counts.items()},
        attachments=attachments,
        run=metadata.get(RUN_METADATA, {}),
        filled=metadata.get(FILLED_METADATA, {}),
    )
