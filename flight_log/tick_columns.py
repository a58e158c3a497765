"""Numbers of every tick between two instants, from a log that may still be written.

Only whole chunks are read, from a given place on, and payloads are taken out by numpy without
decoding messages: a second of ticks takes some milliseconds.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from mcap.opcode import Opcode
from mcap.records import Channel

from flight_log.format import HEAD_BYTES, MAGIC, MESSAGE, RECORD, UNREADABLE, opened
from flight_log.records import records
from quadrotor.errors import LogFormatError, StorageError, UsageError
from vehicle_link.messages.cdr_layout import FixedLayout
from vehicle_link.topics.ticks import SECOND_NS, WORLD, body_frame, layout

Stamps = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float32]

TICK_TOPICS = ("state", "reference", "imu", "actuators")
"""Topics with one message a tick, all with its stamp."""

_HEAD = struct.Struct("<BQH")


class Column(NamedTuple):
    """`item` is None for a single number."""

    topic: str
    field: str
    item: int | None


@dataclass(frozen=True, slots=True)
class Columns:
    """What was read.

    Attributes:
        stamps_ns: shape (N,), rising.
        values: shape (N, columns).
        written_ns: the newest tick seen, 0 if none was.
        ended: the file's end was reached and nothing will be added.
        damaged: chunks that could not be read.
    """

    stamps_ns: Stamps
    values: Floats
    written_ns: int
    ended: bool
    damaged: int


def layouts_of(vehicle: str) -> dict[str, FixedLayout]:
    """Return the layouts of `TICK_TOPICS`, as vehicle_link.topics.ticks encodes them."""
    body = body_frame(vehicle)
    return {
        "state": layout("nav_msgs/Odometry", WORLD, body),
        "reference": layout("quadlab_msgs/Reference", WORLD),
        "imu": layout("sensor_msgs/Imu", body),
        "actuators": layout("quadlab_msgs/Actuators", body),
    }


def parse_column(name: str, layouts: dict[str, FixedLayout]) -> Column:
    """Parse `state.pose.pose.position.0` or `actuators.scaling`. Raises UsageError."""
    topic, _, field = name.partition(".")
    if topic not in layouts:
        raise UsageError(f"no column {name!r:.80}: a topic of {', '.join(layouts)} comes first")
    fields: Mapping[str, Any] = layouts[topic].dtype.fields or {}
    stem, _, last = field.rpartition(".")
    if field in fields and fields[field][0].shape == ():
        return Column(topic, field, None)
    if stem in fields and last.isdecimal():
        shape = fields[stem][0].shape
        if len(shape) == 1 and int(last) < shape[0]:
            return Column(topic, stem, int(last))
    known = ", ".join(f"{n}{list(f[0].shape) or ''}" for n, f in fields.items())
    raise UsageError(f"no column {name!r:.80}: {topic} has {known}")


def read_columns(
    path: Path,
    vehicle: str,
    names: Sequence[str],
    start_ns: int,
    end_ns: int,
    *,
    rows: int,
    offset: int = 0,
) -> Columns:
    """Read at most `rows` ticks with start_ns <= stamp <= end_ns, the earliest first.

    Args:
        offset: a record's place in the file before which no such tick stands.

    A tick counts when all topics of the columns have it. Raises UsageError or StorageError.
    """
    layouts = layouts_of(vehicle)
    columns = [parse_column(name, layouts) for name in names]
    topics = sorted({column.topic for column in columns} | {"state"})
    wanted = {topic: layouts[topic] for topic in topics}
    reader = _Reader(path.name, wanted, start_ns, end_ns, rows)
    try:
        channels = _channels(path, vehicle, topics)
        with path.open("rb") as stream:
            ended = reader.read(stream.fileno(), channels, max(offset, len(MAGIC)))
    except OSError as error:
        raise StorageError(f"cannot read {path.name}: {error.strerror}") from error
    stamps, found = reader.joined()
    values = np.empty((len(stamps), len(columns)), np.float32)
    for j, (topic, field, item) in enumerate(columns):
        column = found[topic][field]
        values[:, j] = column if item is None else column[:, item]
    return Columns(stamps, values, reader.written_ns, ended, reader.damaged)


class _Reader:
    """Collects the rows of each topic, chunk by chunk, until there are enough."""

    def __init__(
        self, name: str, layouts: dict[str, FixedLayout], start_ns: int, end_ns: int, rows: int
    ) -> None:
        self._name = name
        self._layouts = layouts
        self._start_ns, self._end_ns, self._rows = start_ns, end_ns, rows
        self._parts: dict[str, list[npt.NDArray[np.void]]] = {topic: [] for topic in layouts}
        self._stamps: dict[str, list[Stamps]] = {topic: [] for topic in layouts}
        self._newest = dict.fromkeys(layouts, 0)
        self._counts = dict.fromkeys(layouts, 0)
        self.damaged = 0

    @property
    def written_ns(self) -> int:
        return min(self._newest.values())

    def read(self, file: int, channels: dict[int, str], place: int) -> bool:
        """Read on; return whether the file's end was reached and it is closed."""
        size = os.fstat(file).st_size
        while place + RECORD.size <= size and not self._enough():
            head = os.pread(file, RECORD.size, place)
            opcode, length = RECORD.unpack(head)
            place += RECORD.size
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                return True
            if place + length > size:
                break
            if opcode == Opcode.CHUNK:
                try:
                    self._take(opened(self._name, os.pread(file, length, place)), channels)
                except (*UNREADABLE, LogFormatError):
                    self.damaged += 1
            place += length
        return False

    def joined(self) -> tuple[Stamps, dict[str, npt.NDArray[np.void]]]:
        """Return stamps that every topic has, and each topic's records of them."""
        stamps = {topic: _all(parts, np.int64) for topic, parts in self._stamps.items()}
        common = np.unique(stamps["state"])
        for its in stamps.values():
            common = np.intersect1d(common, its)
        common = common[: self._rows]
        found = {}
        for topic, parts in self._parts.items():
            places = np.searchsorted(stamps[topic], common)
            found[topic] = _all(parts, self._layouts[topic].dtype)[places]
        return common, found

    def _enough(self) -> bool:
        # Topics follow one another in the file: the slowest one decides.
        return self.written_ns >= self._end_ns or min(self._counts.values()) > self._rows

    def _take(self, data: bytes, channels: dict[int, str]) -> None:
        places: dict[str, list[int]] = {}
        place, end = 0, len(data)
        while place < end:
            opcode, length, channel = _HEAD.unpack_from(data, place)
            if opcode == Opcode.MESSAGE and channel in channels:
                topic = channels[channel]
                if length == self._layouts[topic].size + MESSAGE.size:
                    places.setdefault(topic, []).append(place + HEAD_BYTES)
            place += RECORD.size + length
        octets = np.frombuffer(data, np.uint8)
        for topic, starts in places.items():
            dtype = self._layouts[topic].dtype
            rows = octets[np.array(starts)[:, None] + np.arange(dtype.itemsize)]
            found = np.ascontiguousarray(rows).view(dtype)[:, 0]
            stamps = found["header.stamp.sec"].astype(np.int64) * SECOND_NS
            stamps += found["header.stamp.nanosec"]
            self._newest[topic] = max(self._newest[topic], int(stamps[-1]))
            wanted = (stamps >= self._start_ns) & (stamps <= self._end_ns)
            self._parts[topic].append(found[wanted])
            self._stamps[topic].append(stamps[wanted])
            self._counts[topic] += int(wanted.sum())


def _channels(path: Path, vehicle: str, topics: Sequence[str]) -> dict[int, str]:
    """Return the topics by channel; they are declared where the first ticks are."""
    wanted = {f"/{vehicle}/{topic}": topic for topic in topics}
    found: dict[int, str] = {}
    for record in records(path):
        if isinstance(record, Channel) and record.topic in wanted:
            found[record.id] = wanted[record.topic]
            if len(found) == len(wanted):
                break
    return found


def _all(parts: Sequence[npt.NDArray[Any]], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    return np.concatenate(parts) if parts else np.zeros(0, dtype)
