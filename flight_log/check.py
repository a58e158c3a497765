"""A check whether a log is sound: complete, consistent with its index, readable, without gaps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from flight_log.index import index_problem
from flight_log.records import ReadState, records
from flight_log.summary import LogSummary, summarize
from flight_log.topic_columns import ColumnReader, Columns
from quadrotor.errors import LogFormatError
from vehicle_link.topics.table import SHARED, TOPICS

GAP = 5.0
"""Number of a topic's periods without a message that make a gap."""
SHORTEST_GAP_S = 0.1
"""Shortest gap, in s, that is reported, whatever the topic's period."""
OVERTAKEN = frozenset(row.name for row in TOPICS.values() if row.on_radio and not row.qos.reliable)
"""Topics whose messages may overtake one another on the radio; recorded in order of arrival."""
FEWEST_STEPS = 10
"""Least number of steps in a block for their median to be the usual one."""
RATE_MIN = 1.0
"""Hz; topics with a lower rate are published on change."""

_YEAR = 3.2e7  # s; a longer duration means a damaged time


@dataclass
class TopicCheck:
    """The check of one topic; times in s, from the stamps of the source."""

    type_name: str
    count: int = 0
    duration: float = 0.0
    gaps: list[tuple[float, float]] = field(default_factory=list)  # begin since the start, length
    backwards: int = 0  # stamps before the preceding one
    out_of_order: int = 0  # receptions before the preceding one
    first_ns: int = 0
    last_ns: int = 0
    last_log_ns: int = 0
    usual_ns: float = 0.0  # median step between two stamps of the newest block with enough of them

    @property
    def rate(self) -> float:
        """Return the rate in Hz."""
        return (self.count - 1) / self.duration if self.duration > 0.0 else 0.0

    @property
    def missing(self) -> float:
        """Return the seconds in gaps."""
        return sum(length for _, length in self.gaps)


@dataclass
class LogCheck:
    """The findings of a check.

    Attributes:
        problems: what makes the log unsound, a line each; empty for a sound one.
        notes: what a reader should know.
    """

    path: Path
    topics: dict[str, TopicCheck] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def count(self) -> int:
        return sum(topic.count for topic in self.topics.values())


def check_log(path: Path, progress: Callable[[float], None] = lambda share: None) -> LogCheck:
    """Check a log; reads the whole file.

    Args:
        progress: called with the share read, 0…1.

    Raises LogFormatError or StorageError when it is no log or cannot be read.
    """
    found = LogCheck(path)
    index = index_problem(path)
    reader = ColumnReader(path)
    for batch in reader:
        for columns in batch.columns:
            topic = found.topics.setdefault(columns.topic, TopicCheck(columns.type_name))
            _look(topic, columns)
        progress(batch.share)
    if reader.log.tear or index:
        why = f"is torn: it {reader.log.tear}" if reader.log.tear else index
        found.problems.append(f"it {why}; repair it: quadlab log recover {path}")
    if reader.log.damaged_chunks:
        found.problems.append(
            f"{reader.log.damaged_chunks} damaged chunks, whose messages are lost"
        )
    if reader.log.damaged_records:
        found.problems.append(
            f"{reader.log.damaged_records} damaged records: attachments, metadata or descriptions"
        )
    found.notes += [
        f"{name} has other fields here than in this version of quadlab: another one recorded it"
        for name in sorted(reader.foreign)
    ]
    found.problems += [f"{topic}: {line}" for topic, line in reader.problems.items()]
    if not found.problems:
        _compare_with_index(found)
    _judge(found)
    return found


def _look(topic: TopicCheck, columns: Columns) -> None:
    """Add a block of one topic."""
    stamps, received = columns.publish_ns, columns.log_ns
    if not len(stamps):
        return
    began = topic.count == 0
    if began:
        topic.first_ns = int(stamps[0])
    steps = np.diff(stamps) if began else np.diff(stamps, prepend=topic.last_ns)
    receptions = np.diff(received) if began else np.diff(received, prepend=topic.last_log_ns)
    topic.backwards += int((steps < 0).sum())
    topic.out_of_order += int((receptions < 0).sum())
    if len(steps) >= FEWEST_STEPS or not topic.usual_ns:
        topic.usual_ns = float(np.median(steps)) if len(steps) else 0.0
    period = _period(columns.topic, topic.usual_ns)
    if period:
        longest = max(GAP * period, SHORTEST_GAP_S * 1e9)
        begins = stamps if began else np.concatenate([[topic.last_ns], stamps])
        for k in np.flatnonzero(steps > longest).tolist():
            begin = (int(begins[k]) - topic.first_ns) * 1e-9
            topic.gaps.append((begin, float(steps[k]) * 1e-9))
    topic.count += len(stamps)
    topic.last_ns, topic.last_log_ns = int(stamps[-1]), int(received[-1])
    topic.duration = (topic.last_ns - topic.first_ns) * 1e-9


def _period(name: str, usual_ns: float) -> float:
    """Return the ns between two messages; 0 for topics without a rate.

    It is the table's, or the usual one of this log where that is longer: another system's topic of
    the same name may have a rate of its own.
    """
    row = TOPICS.get(name.rsplit("/", 1)[-1])
    if row is not None:
        return max(1e9 / row.rate, usual_ns) if row.rate else 0.0
    return usual_ns if 0.0 < usual_ns < 1e9 / RATE_MIN else 0.0


def _compare_with_index(found: LogCheck) -> None:
    try:
        index: LogSummary = summarize(found.path)
    except LogFormatError as error:
        found.problems.append(str(error))
        return
    for topic, stated in index.topics.items():
        counted = found.topics[topic].count if topic in found.topics else 0
        if counted != stated.count:
            found.problems.append(
                f"{topic}: the index states {stated.count} messages, the file has {counted}"
            )
    if index.recovered:
        found.notes.append("it was torn and has been repaired")


def _why_backwards(name: str) -> str:
    """Return why stamps may go back in this topic of a sound log; "" if they may not."""
    topic = name.rsplit("/", 1)[-1]
    if topic in OVERTAKEN:
        return "datagrams overtook one another"
    return "vehicle and station each stamp their own" if topic in SHARED else ""


def _judge(found: LogCheck) -> None:
    for name, topic in sorted(found.topics.items()):
        if topic.backwards:
            line, harmless = f"{name}: {topic.backwards} stamps go back", _why_backwards(name)
            if harmless:
                found.notes.append(f"{line}: {harmless}")
            else:
                found.problems.append(line)
        if topic.out_of_order:
            found.problems.append(f"{name}: {topic.out_of_order} receptions go back")
        if topic.gaps:
            begin, longest = max(topic.gaps, key=lambda gap: gap[1])
            found.notes.append(
                f"{name}: {len(topic.gaps)} gaps, {topic.missing:.2f} s in all, the longest "
                f"{longest:.2f} s at {begin:.2f} s"
            )


def damage(path: Path) -> list[str]:
    """Return a line for each damaged chunk or other record: its place and its messages' times.

    Reads the whole file. Raises LogFormatError or StorageError.
    """
    state, start_ns = ReadState(), 0
    for record in records(path, state):
        start_ns = start_ns or getattr(record, "log_ns", 0)
    found = []
    for one in state.damaged:
        what = "a chunk" if one.is_chunk else "an attachment, metadata or a description"
        # The times precede the compressed part, and may be damaged themselves.
        since, until = ((ns - start_ns) * 1e-9 for ns in one.times_ns)
        is_sound = one.is_chunk and 0.0 <= since <= until < _YEAR
        when = f", with the messages from {since:.3f} to {until:.3f} s" if is_sound else ""
        found.append(f"{what} of {one.size} bytes at byte {one.place}{when}")
    if left := state.damaged_chunks + state.damaged_records - len(found):
        found.append(f"{left} more such records")
    return found
