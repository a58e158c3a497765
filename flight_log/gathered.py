"""A log's topics gathered whole: stamps, a column for each number, texts where they change.

Columns grow in memory, or in files of a folder where a log may be too long for that. Most numbers
of a log never change (covariances, counters of what did not happen): a column costs nothing until
its first other value. numpy, not Arrow: a topic may have new columns until its last message.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from flight_log.topic_columns import ColumnReader, Columns
from quadrotor.errors import LogFormatError

Floats = npt.NDArray[np.floating[Any]]
Stamps = npt.NDArray[np.int64]

HEADER_STAMP = ("header.stamp.sec", "header.stamp.nanosec")

OBJECT_BYTES = 80
"""Size of a text or payload besides its letters."""


class Growing:
    """Numbers of one kind that arrive in pieces; kept in the file `path`, None for in memory."""

    def __init__(self, kind: npt.DTypeLike, path: Path | None) -> None:
        self._kind, self._path = np.dtype(kind), path
        self._held = bytearray()
        self.count = 0

    @property
    def size(self) -> int:
        """Return the bytes of memory it takes."""
        return len(self._held)

    def extend(self, values: npt.NDArray[Any]) -> None:
        """Add values, shape (N,). Raises OSError."""
        self.count += len(values)
        values = values.astype(self._kind, copy=False)
        if self._path is None:
            self._held += values.tobytes()
            return
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("ab") as file:
            values.tofile(file)

    def read(self) -> npt.NDArray[Any]:
        """Return all of it, shape (count,), after the last value was added."""
        if self._path is None:
            return np.frombuffer(self._held, self._kind)
        return np.fromfile(self._path, self._kind) if self.count else np.zeros(0, self._kind)


class Column:
    """Numbers of one kind, NaN where a message has none."""

    def __init__(self, path: Path | None, dtype: np.dtype[Any]) -> None:
        self._first = dtype.type(np.nan)
        self._values = Growing(dtype, path)
        self.count = 0

    @property
    def size(self) -> int:
        """Return the bytes of memory it takes."""
        return self._values.size

    @property
    def constant(self) -> float | None:
        """Return its one value, NaN if it has none at all, None if it has several."""
        return None if self._values.count else float(self._first)

    def extend(self, values: npt.NDArray[Any]) -> None:
        """Add values, shape (N,). Raises OSError."""
        if len(values) == 0:
            return
        if not self._values.count:
            if self.count == 0:
                self._first = values[0]
            same = np.isnan(values) if np.isnan(self._first) else values == self._first
            if same.all():
                self.count += len(values)
                return
            self._values.extend(np.full(self.count, self._first))
        self._values.extend(values)
        self.count += len(values)

    def fill(self, count: int) -> None:
        """Add NaN up to `count` values, for messages without this number."""
        if count > self.count:
            self.extend(np.full(count - self.count, np.nan, self._first.dtype))

    def read(self) -> Floats:
        """Return all of it, shape (count,), not to be written into."""
        if not self._values.count:
            return np.broadcast_to(self._first, self.count)
        return self._values.read()


class Topic:
    """N messages of one topic, in the order they were written.

    Args:
        folder: where its columns are kept; None for in memory.
        most_payloads: how many payloads of a topic wanted whole are kept.
        received: whether the stamps of reception are kept too.
        dtype: of its numbers.

    Attributes:
        texts: of each the places (index, text) where it changes.
    """

    def __init__(
        self,
        type_name: str,
        folder: Path | None = None,
        most_payloads: int = 0,
        *,
        received: bool = True,
        dtype: npt.DTypeLike = np.float32,
    ) -> None:
        self.type_name, self._dtype = type_name, np.dtype(dtype)
        self.columns: dict[str, Column] = {}
        self.texts: dict[str, list[tuple[int, str]]] = {}
        self.payloads: list[bytes] = []
        self._folder, self._most_payloads, self._received = folder, most_payloads, received
        self._log_ns = Growing(np.int64, folder and folder / "log")
        self._publish_ns = Growing(np.int64, folder and folder / "publish")
        self._count = self._written = 0  # messages; bytes of payloads and texts

    def __len__(self) -> int:
        return self._count

    def extend(self, columns: Columns, room: float = math.inf) -> int:
        """Add messages, with at most `room` new columns; return how many are new."""
        made, before = 0, self._count
        self._count += len(columns.log_ns)
        self._publish_ns.extend(columns.publish_ns)
        if self._received:
            self._log_ns.extend(columns.log_ns)
        for path, values in columns.numbers.items():
            column = self.columns.get(path)
            if column is None:
                if made >= room:
                    continue
                made += 1
                name = str(len(self.columns))
                column = self.columns[path] = Column(
                    self._folder and self._folder / name, self._dtype
                )
            column.fill(before)
            column.extend(values)
        payloads = columns.payloads[: max(self._most_payloads - len(self.payloads), 0)]
        self.payloads += payloads
        self._written += sum(len(one) + OBJECT_BYTES for one in payloads)
        for path, told in columns.texts.items():
            self.texts.setdefault(path, []).extend((before + index, text) for index, text in told)
            self._written += sum(len(text) + 2 * OBJECT_BYTES for _, text in told)
        return made

    @property
    def size(self) -> int:
        """Return the bytes of memory it takes; texts count where they change."""
        stamps = self._publish_ns.size + self._log_ns.size
        return stamps + self._written + sum(one.size for one in self.columns.values())

    @property
    def log_ns(self) -> Stamps:
        """Return the stamps of reception at the writer, (N,); empty when they are not kept."""
        return self._log_ns.read()

    @property
    def publish_ns(self) -> Stamps:
        """Return the stamps of the source, (N,)."""
        return self._publish_ns.read()

    @property
    def header_ns(self) -> Stamps:
        """Return the stamps in the messages' headers, (N,), where HEADER_STAMP was read as
        float64.
        """
        seconds, rest = (self.values(name).astype(np.int64) for name in HEADER_STAMP)
        return seconds * 1_000_000_000 + rest

    def give_up_stamps(self) -> None:
        """Free the stamps after their last use: of a long log they are most of it."""
        self._log_ns, self._publish_ns = Growing(np.int64, None), Growing(np.int64, None)

    def values(self, name: str) -> Floats:
        """Return a number, (N,), NaN where there is none; not to be written into."""
        column = self.columns.get(name)
        if column is None:
            return np.broadcast_to(np.array(np.nan, self._dtype), len(self))
        column.fill(len(self))
        return column.read()

    def take(self, names: Collection[str]) -> Floats:
        """Return (N, len(names)), NaN for a number the topic does not have; free the columns."""
        out = np.empty((len(self), len(names)), self._dtype)
        for k, name in enumerate(names):
            out[:, k] = self.values(name)
            self.columns.pop(name, None)
        return out


def gather(
    reader: ColumnReader,
    look: Callable[[dict[str, Topic], float], None] = lambda topics, share: None,
    *,
    folder: Path | None = None,
    most_payloads: int = 1_000_000,
    most_columns: float = math.inf,
    most_bytes: float = math.inf,
    received: bool = True,
) -> dict[str, Topic]:
    """Return all that `reader` gives, by topic; of each the messages of its first type.

    Args:
        look: told all so far, and the share of the file read, after each block.
        folder: where columns are kept; None for in memory.

    Raises as `reader` and `look` do, OSError, and LogFormatError when it is more than `most_bytes`.
    """
    topics: dict[str, Topic] = {}
    for batch in reader:
        for columns in batch.columns:
            topic = topics.get(columns.topic)
            if topic is None:
                place = folder and folder / f"topic{len(topics)}"
                topic = topics[columns.topic] = Topic(
                    columns.type_name, place, most_payloads, received=received, dtype=reader.dtype
                )
            if topic.type_name == columns.type_name:
                most_columns -= topic.extend(columns, most_columns)
        if sum(one.size for one in topics.values()) > most_bytes:
            raise LogFormatError(
                f"{reader.log.path.name} has more than {most_bytes / 1e6:.0f} MB of times and "
                "values to hold at once: cut it with `mcap filter --include-attachments "
                "--output-compression lz4 --start … --end …`, or export it with `quadlab log "
                "export`"
            )
        look(topics, batch.share)
    return topics


def read_topics(
    log: Path,
    vehicle: str,
    wanted: Mapping[str, Collection[str]],
    whole: tuple[str, ...] = (),
    dtype: npt.DTypeLike = np.float32,
) -> dict[str, Topic]:
    """Return topics of one vehicle, by name without namespace; one without messages is empty.

    Args:
        wanted: paths of numbers and texts by topic.
        whole: of these topics, ends of their names, the payloads.

    Raises LogFormatError or StorageError.
    """
    found = gather(ColumnReader(log, whole, wanted, dtype=dtype), received=False)
    names = dict.fromkeys((*wanted, *(one.lstrip("/") for one in whole)))
    return {name: found.get(f"/{vehicle}/{name}") or Topic("") for name in names}
