"""A log's topics as Arrow tables, made from its columns.

A row is a message: when it was true (`stamp_ns`), when it was received (`received_ns`), each by the
clock that the log has it from, `time` in s since the log's first reception, then numbers and texts
of the message.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight_log.columns.log_columns import read_columns
from flight_log.columns.topic import Topic
from flight_log.columns.writer import RECEIVED, STAMP
from flight_log.summary import summarize
from quadrotor.errors import UsageError
from quadrotor.similar_names import did_you_mean
from vehicle_link.messages.units import unit_of_path

ROWS = 20_000
"""Maximum number of rows of a piece."""
TIME_UNITS = {"time": "s", STAMP: "ns", RECEIVED: "ns"}


@dataclass
class Piece:
    """A number of rows of one topic."""

    topic: str  # `state`; with its namespace when the log has several
    type_name: str
    table: Any  # a pyarrow.Table: float64, int64 and texts, units in the fields' metadata
    share: float  # of the log's rows so far, 0…1


class Tables:
    """The tables of a log.

    Args:
        topics: names as `quadlab log info` lists them, or their last part; none for all.
        begin, end: s since the first reception; rows received in between are kept.
        progress: called with the share of the log that has been read, 0 to 1, if it must be read.

    Attributes:
        problems: a line for each topic that could not be read.
        missing: the part of the file that could not be read; "" when all was read.
        note: why its columns are not stored; "" when they are.

    Raises UsageError for a missing topic or an empty range, LogFormatError, StorageError.
    """

    def __init__(
        self,
        path: Path,
        topics: Sequence[str] = (),
        begin: float = 0.0,
        end: float = np.inf,
        progress: Callable[[float], None] = lambda share: None,
    ) -> None:
        if not begin < end:
            raise UsageError(f"from {begin:g} to {end:g} s is empty; give a --from below --to")
        summary = summarize(path)
        if begin > summary.duration:
            raise UsageError(
                f"--from {begin:g}: the log has {summary.duration:.1f} s; give less than that"
            )
        self.run = summary.run
        self._names = _short_names(summary.topics)
        wanted = [_resolved(word, self._names) for word in topics] or list(self._names)
        log = read_columns(path, progress, np.float64)
        self._topics = {name: topic for name, topic in log.topics.items() if name in wanted}
        self.problems = {name: why for name, why in log.problems.items() if name in wanted}
        lost = [f"it {log.tear}"] if log.tear else []
        lost += [f"{log.damaged_chunks} of its chunks are damaged"] if log.damaged_chunks else []
        self.missing, self.note = ", and ".join(lost), log.note
        self._start_ns, self._begin, self._end = summary.start_ns, begin, end

    def whole(self) -> Iterator[Piece]:
        """Yield each topic as one table."""
        total, done = sum(map(len, self._topics.values())), 0
        for name, topic in self._topics.items():
            table = _table(topic, self._start_ns)
            if self._begin > 0.0 or np.isfinite(self._end):
                time = table["time"].to_numpy()
                table = table.filter((time >= self._begin) & (time <= self._end))
            done += len(topic)
            if table.num_rows:
                yield Piece(self._names[name], topic.type_name, table, done / total)
            topic.release()

    def __iter__(self) -> Iterator[Piece]:
        """Yield all topics in pieces of at most ROWS rows."""
        for one in self.whole():
            for begin in range(0, one.table.num_rows, ROWS):
                table = one.table.slice(begin, ROWS)
                yield Piece(one.topic, one.type_name, table, one.share)


def _table(topic: Topic, start_ns: int) -> Any:
    """Return a topic's table. Numbers are not copied, and equal constants share a column."""
    import pyarrow as pa

    columns = {"time": pa.array((topic.log_ns - start_ns) * 1e-9)}
    columns |= {name: topic.arrow[name] for name in (STAMP, RECEIVED)}
    units = dict(TIME_UNITS)
    constants: dict[bytes, Any] = {}
    for name in topic.names:
        if name in topic.constants:
            bits = np.float64(topic.constants[name]).tobytes()
            if bits not in constants:
                constants[bits] = pa.repeat(pa.scalar(topic.constants[name]), len(topic))
            columns[name] = constants[bits]
        else:
            columns[name] = topic.arrow[name]
        plain = ".".join(part.split("[")[0] for part in name.split("."))
        if unit := unit_of_path(topic.type_name, plain):
            units[name] = unit
    for name, changes in topic.texts.items():
        begins = [0, *(index for index, _ in changes)]
        ends = [*begins[1:], len(topic)]
        texts = ["", *(text for _, text in changes)]
        spread = [
            pa.repeat(pa.scalar(text), end - begin)
            for text, begin, end in zip(texts, begins, ends, strict=True)
            if end > begin
        ]
        columns[name] = pa.chunked_array(spread)
    fields = [
        pa.field(name, one.type, metadata={"unit": units[name]} if name in units else None)
        for name, one in columns.items()
    ]
    return pa.Table.from_arrays(list(columns.values()), schema=pa.schema(fields))


def _short_names(topics: Iterable[str]) -> dict[str, str]:
    """Return the last part of each topic's name, or the whole name when two would be equal."""
    short = {topic: topic.strip("/").split("/", 1)[-1].replace("/", "_") for topic in topics}
    names = list(short.values())
    return {
        topic: name if names.count(name) == 1 else topic.strip("/").replace("/", "_")
        for topic, name in short.items()
    }


def _resolved(word: str, names: dict[str, str]) -> str:
    for topic, name in names.items():
        if word in (topic, name, topic.strip("/")):
            return topic
    raise UsageError(
        f"no topic {word!r} in this log; {did_you_mean(word, names.values(), after=' ')}there are "
        f"{', '.join(sorted(names.values()))}"
    )
