"""A log's topics as tables, piece by piece.

A row is a message: when it was true (`stamp_ns`), when it was received (`received_ns`), both by
the clocks that the log has them from, `time` in s since the log's first reception, then numbers
and texts of the message.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from flight_log.summary import summarize
from flight_log.topic_columns import ColumnReader, Columns
from quadrotor.errors import UsageError
from vehicle_link.messages.units import unit_of_path

Array = npt.NDArray[Any]
TIME_UNITS = {"time": "s", "stamp_ns": "ns", "received_ns": "ns"}


@dataclass
class Piece:
    """Some rows of one topic."""

    topic: str  # `state`; with its namespace when the log has several
    type_name: str
    columns: dict[str, Array]  # (N,) each: float64, int64, or objects that are str
    units: dict[str, str]  # of columns that have one
    share: float  # of the log read so far, 0…1

    @property
    def rows(self) -> int:
        return len(self.columns["time"])


class Tables:
    """Iterate once.

    Args:
        topics: names as `quadlab log info` tells them, or their last part; none for all.
        begin, end: s since the first reception; rows received then are kept.

    Attributes:
        problems: a line for each topic that could not be read, after the iteration.

    Raises UsageError for a topic that is not there or an empty range, LogFormatError, StorageError.
    """

    def __init__(
        self, path: Path, topics: Sequence[str] = (), begin: float = 0.0, end: float = np.inf
    ) -> None:
        if not begin < end:
            raise UsageError(f"from {begin:g} to {end:g} s is no time; give --from below --to")
        summary = summarize(path)
        if begin > summary.duration:
            raise UsageError(
                f"--from {begin:g}: the log has {summary.duration:.1f} s; give less than that"
            )
        self.run = summary.run
        self._names = _short_names(summary.topics)
        wanted = [_resolved(word, self._names) for word in topics]
        self._reader = ColumnReader(path, topics=wanted or None, dtype=np.float64)
        self._start_ns, self._begin, self._end = summary.start_ns, begin, end
        self._texts: dict[tuple[str, str], str] = {}

    @property
    def problems(self) -> dict[str, str]:
        return self._reader.problems

    @property
    def missing(self) -> str:
        """Return what of the file could not be read, after the iteration; "" when all was."""
        log = self._reader.log
        lost = [f"it {log.tear}"] if log.tear else []
        lost += [f"{log.damaged_chunks} of its chunks are damaged"] if log.damaged_chunks else []
        return ", and ".join(lost)

    def __iter__(self) -> Iterator[Piece]:
        growing: dict[str, _Growing] = {}
        with ExitStack() as files:
            for batch in self._reader:
                for columns in batch.columns:
                    piece = self._piece(columns, batch.share)
                    if columns.grows:  # which columns there are is known at the end
                        if columns.topic not in growing:
                            growing[columns.topic] = _Growing(files.enter_context(TemporaryFile()))
                        growing[columns.topic].add(piece)
                    elif piece.rows:
                        yield piece
            for one in growing.values():
                yield from one.pieces()

    def _piece(self, columns: Columns, share: float) -> Piece:
        time = (columns.log_ns - self._start_ns) * 1e-9
        kept = (time >= self._begin) & (time <= self._end)
        table: dict[str, Array] = {
            "time": time,
            "stamp_ns": columns.publish_ns,
            "received_ns": columns.log_ns,
        }
        units = dict(TIME_UNITS)
        for path, values in columns.numbers.items():
            table[path] = values
            plain = ".".join(part.split("[")[0] for part in path.split("."))
            if unit := unit_of_path(columns.type_name, plain):
                units[path] = unit
        for path, changes in columns.texts.items():
            table[path] = self._spread(columns.topic, path, changes, len(time))
        if not kept.all():
            table = {name: values[kept] for name, values in table.items()}
        return Piece(self._names[columns.topic], columns.type_name, table, units, share)

    def _spread(self, topic: str, path: str, changes: list[tuple[int, str]], count: int) -> Array:
        """Return a text of each row from the rows where it changes."""
        out = np.empty(count, object)
        text, at = self._texts.get((topic, path), ""), 0
        for index, changed in [*changes, (count, "")]:
            out[at:index] = text
            if index < count:
                text, at = changed, index
        self._texts[topic, path] = text
        return out


class _Growing:
    """Pieces of a topic whose columns are known at the end, kept in a file until then."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._kinds: dict[str, np.dtype[Any]] = {}
        self._units: dict[str, str] = {}

    def add(self, piece: Piece) -> None:
        """Add a piece. Raises OSError."""
        if not piece.rows:
            return
        for name, values in piece.columns.items():
            self._kinds.setdefault(name, values.dtype)
        self._units.update(piece.units)
        pickle.dump(piece, self._file, pickle.HIGHEST_PROTOCOL)

    def pieces(self) -> Iterator[Piece]:
        """Yield the pieces, with NaN, or no text, where a piece lacks a column. Raises OSError."""
        end = self._file.tell()
        self._file.seek(0)
        while self._file.tell() < end:
            piece: Piece = pickle.load(self._file)
            columns = {
                name: piece.columns[name]
                if name in piece.columns
                else np.full(piece.rows, "" if kind.kind == "O" else np.nan, kind)
                for name, kind in self._kinds.items()
            }
            yield replace(piece, columns=columns, units=dict(self._units))


def _short_names(topics: Sequence[str] | dict[str, Any]) -> dict[str, str]:
    """Return the last part of each topic's name, or all of it where two would be the same."""
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
        f"no topic {word!r} in this log; there are {', '.join(sorted(names.values()))}"
    )
