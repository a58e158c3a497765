"""The messages of a log as columns of numbers and texts, block by block.

Every topic has: when each message was valid and when it was received, a column for each number of
its type (by path, `pose.pose.position.x`), and for each text the rows where it changes.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from mcap.records import Schema

from flight_log.attached import logged_value
from flight_log.blocks import Block, BlockReader, Bytes, Places, field_at, rows_at
from flight_log.format import HEAD_BYTES, LENGTH_AT, LOG_AT, PUBLISH_AT
from flight_log.payload_layout import MAX_NUMBERS, PayloadLayout, SchemaLayouts
from quadrotor.errors import LinkError, LogFormatError
from quadrotor.records import Stamps
from vehicle_link.messages import decode

MAX_LAYOUTS = 200
"""Number of layouts tried for a block's payloads of one size; messages beyond them are lost."""
MAX_FAILURES = 2000
"""Number of unreadable messages of a topic after which the rest of it is skipped."""
MAX_ROWS = 4096
"""Largest number of a topic's messages in a piece: at 10 bytes each, a block has 100 000."""
MAX_VALUES = 4_000_000
"""Largest number of values in the pieces that are yielded together."""

NO_SCHEMA = Schema(id=0, name="", encoding="", data=b"")

Floats = npt.NDArray[np.float64]


@dataclass
class Columns:
    """N messages of one topic, in the order in which they were written."""

    topic: str
    type_name: str
    log_ns: Stamps  # (N,) reception at the writer
    publish_ns: Stamps  # (N,) the source's stamp
    # (N,) each, NaN where missing; integers beyond 2^53 are rounded
    numbers: dict[str, Floats] = field(default_factory=dict)
    texts: dict[str, list[tuple[int, str]]] = field(default_factory=dict)  # index, text from it on
    payloads: list[bytes] = field(default_factory=list)  # of the topics in `whole`


class Batch(NamedTuple):
    """The columns of one block, or of a part of it if it has too many numbers."""

    columns: list[Columns]
    share: float  # of the file read so far, 0 to 1


class ColumnReader:
    """Iterator over a log's columns, to be used once.

    Args:
        whole: ends of topic names (`/events`) whose payloads are read too.
        header_stamps: whether the numbers of HEADER_STAMP are read; otherwise no header is.

    Attributes:
        problems: one line for each topic that could not be read.
        foreign: message types whose fields differ from those in this version.

    Raises LogFormatError or StorageError.
    """

    def __init__(
        self, path: Path, whole: tuple[str, ...] = (), header_stamps: bool = False
    ) -> None:
        self.log = BlockReader(path)
        self._header_stamps = header_stamps
        self.problems: dict[str, str] = {}
        self.foreign: set[str] = set()
        self._whole = whole
        self._topics: dict[int, _TopicReader | None] = {}

    def __iter__(self) -> Iterator[Batch]:
        for block in self.log:
            columns: list[Columns] = []
            for channel, places in block.places.items():
                reader = self._reader(channel)
                if reader is None:
                    continue
                for begin in range(0, len(places), MAX_ROWS):
                    columns.append(reader.read(block, places[begin : begin + MAX_ROWS]))
                    if reader.problem:
                        self.problems.setdefault(columns[-1].topic, reader.problem)
                    if sum(map(_values, columns)) > MAX_VALUES:
                        yield Batch(columns, block.share)
                        columns = []
            yield Batch(columns, block.share)

    def _reader(self, channel_id: int) -> _TopicReader | None:
        if channel_id in self._topics:
            return self._topics[channel_id]
        reader: _TopicReader | None = None
        channel = self.log.channels.get(channel_id)
        if channel is None:
            self.problems[f"channel {channel_id}"] = "its description was in a damaged chunk"
        schema = self.log.schemas.get(channel.schema_id, NO_SCHEMA) if channel else None
        if channel is not None and schema is not None:
            try:
                if channel.message_encoding != "cdr":
                    raise LogFormatError(
                        f"its messages are in {channel.message_encoding!r:.40}; only 'cdr' (ROS 2) "
                        "is read"
                    )
                if schema is NO_SCHEMA:
                    raise LogFormatError("the log does not describe its messages")
                layouts = SchemaLayouts(schema, stamps=self._header_stamps)
                self.foreign.update(layouts.foreign)
                is_whole = channel.topic.endswith(self._whole)
                reader = _TopicReader(channel.topic, schema.name, layouts, is_whole)
            except LogFormatError as error:
                self.problems[channel.topic] = str(error)
        self._topics[channel_id] = reader
        return reader


class _TopicReader:
    def __init__(self, topic: str, type_name: str, layouts: SchemaLayouts, whole: bool) -> None:
        self._topic = topic
        self._type_name = type_name
        self._layouts = layouts
        self._whole = whole
        self._known: dict[int, list[PayloadLayout]] = {}  # by size
        self._last: dict[str, str] = {}
        self._seen: set[str] = set()  # paths of numbers and texts
        self._failures = 0
        self.problem = ""  # the first message that could not be read

    def read(self, block: Block, places: Places) -> Columns:
        data = block.data
        sizes = field_at(data, places, LENGTH_AT, "<u8").astype(np.int64) + 9 - HEAD_BYTES
        sound = (sizes >= 0) & (places + HEAD_BYTES + sizes <= len(data))
        places, sizes = places[sound], sizes[sound]
        out = Columns(
            self._topic,
            self._type_name,
            field_at(data, places, LOG_AT, "<i8"),
            field_at(data, places, PUBLISH_AT, "<i8"),
        )
        texts: dict[str, npt.NDArray[Any]] = {}
        for size in sorted(set(sizes.tolist())):
            chosen = np.flatnonzero(sizes == size)
            rows = rows_at(data, places[chosen] + HEAD_BYTES, size)
            self._read_size(rows, chosen, out, texts)
        for path, column in texts.items():
            out.texts[path] = self._changes(path, column)
        if self._whole:
            begins = (places + HEAD_BYTES).tolist()
            out.payloads = [
                data[begin : begin + size].tobytes()
                for begin, size in zip(begins, sizes.tolist(), strict=True)
            ]
        return out

    def _read_size(
        self, rows: Bytes, chosen: Places, out: Columns, texts: dict[str, npt.NDArray[Any]]
    ) -> None:
        """Read payloads (N, size), which belong at the rows `chosen` of the columns."""
        known = self._known.setdefault(rows.shape[1], [])
        left = np.ones(len(rows), bool)
        for k in range(MAX_LAYOUTS):
            if not left.any() or self._failures > MAX_FAILURES:
                return
            if k < len(known):
                layout = known[k]
            else:
                try:
                    layout = self._layouts.of(rows[np.argmax(left)].tobytes())
                except LogFormatError as error:  # of this message only
                    self.problem = self.problem or str(error)
                    left[np.argmax(left)] = False
                    self._failures += 1
                    continue
                known.append(self._bounded(layout))
                layout = known[-1]
            here = left & layout.fits(rows)
            if here.any():
                whole = bool(here.all())
                _fill(rows if whole else rows[here], chosen[here], layout, out, texts)
            left &= ~here

    def _bounded(self, layout: PayloadLayout) -> PayloadLayout:
        """Return the layout; if there are too many numbers and texts, without those that no earlier
        message had.
        """
        paths = self._seen | layout.numbers.keys() | layout.texts.keys()
        if len(paths) <= MAX_NUMBERS:
            self._seen = paths
            return layout
        self.problem = self.problem or f"more than {MAX_NUMBERS} numbers; the others are left out"
        return _narrowed(layout, frozenset(self._seen))

    def _changes(self, path: str, column: npt.NDArray[Any]) -> list[tuple[int, str]]:
        """Return where a text differs from the previous one, as (row, text); None means no text."""
        found = []
        begins = np.flatnonzero(np.concatenate([[True], column[1:] != column[:-1]]))
        for index in begins.tolist():
            text = column[index]
            if text is not None and self._last.get(path) != text:
                self._last[path] = text
                found.append((index, text))
        return found


def _values(columns: Columns) -> int:
    return (len(columns.numbers) + len(columns.texts) + 2) * len(columns.log_ns)


def _narrowed(layout: PayloadLayout, paths: frozenset[str]) -> PayloadLayout:
    """Return the layout restricted to these numbers and texts."""
    return PayloadLayout(
        layout.size,
        layout.lengths,
        {path: place for path, place in layout.numbers.items() if path in paths},
        {path: pieces for path, pieces in layout.texts.items() if path in paths},
    )


def _fill(
    rows: Bytes,
    chosen: Places,
    layout: PayloadLayout,
    out: Columns,
    texts: dict[str, npt.NDArray[Any]],
) -> None:
    count = len(out.log_ns)
    if layout.numbers:
        read = np.ascontiguousarray(rows).view(layout.record)[:, 0]
        with np.errstate(over="ignore", invalid="ignore"):
            for path in layout.numbers:
                if len(rows) == count:  # all messages have this layout
                    out.numbers[path] = read[path].astype(np.float64)
                    continue
                column = out.numbers.get(path)
                if column is None:
                    column = out.numbers[path] = np.full(count, np.nan)
                column[chosen] = read[path]
    for path, pieces in layout.texts.items():
        column = texts.get(path)
        if column is None:
            column = texts[path] = np.full(count, None, object)
        column[chosen] = _joined(rows, pieces)


def _joined(rows: Bytes, pieces: list[tuple[int, int]]) -> npt.NDArray[Any]:
    """Return the text of each row, a sequence's items separated by commas; shape (N,)."""
    size = sum(length for _, length in pieces)
    if not size:
        return np.full(len(rows), "", object)
    merged = np.concatenate([rows[:, offset : offset + length] for offset, length in pieces], 1)
    if (merged == merged[0]).all():  # most texts never change, and sorting them takes long
        merged = merged[:1]
    distinct, which = np.unique(merged.view(f"V{size}")[:, 0], return_inverse=True)
    made = np.empty(len(distinct), object)
    for k, one in enumerate(distinct):
        raw, at, words = one.tobytes(), 0, []
        for _, length in pieces:
            words.append(raw[at : at + length].decode(errors="replace"))
            at += length
        made[k] = ", ".join(words)
    joined: npt.NDArray[Any] = made[which]
    return joined if len(joined) == len(rows) else joined.repeat(len(rows))


def text_fields(payload: bytes, type_name: str) -> dict[str, Any]:
    """Return a message's own texts, numbers and parameter values; empty if unreadable."""
    try:
        message = decode(payload, type_name)
    except (LinkError, KeyError):
        return {}
    found = {}
    for name in message.__dataclass_fields__:
        value = getattr(message, name)
        if name in ("old_value", "new_value"):
            with suppress(LogFormatError):
                value = logged_value(value)
        if isinstance(value, str | bool | int | float) and not name.isupper():
            found[name] = value
    return found
