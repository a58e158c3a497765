"""Numbers of every tick between two instants, from a log that may still be being written.

Only complete chunks are read, from a given offset on, and numpy extracts the payloads without
decoding messages: a second of ticks takes some milliseconds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from mcap.records import Channel

from flight_log.blocks import Block, BlockReader, Places, field_at, rows_at
from flight_log.format import HEAD_BYTES, LENGTH_AT, MAGIC, MESSAGE
from flight_log.mcap_writer import CHUNK_BYTES
from flight_log.records import records
from quadrotor.errors import UsageError
from quadrotor.records import Stamps
from vehicle_link.messages.cdr_layout import FixedLayout
from vehicle_link.topics.ticks import SECOND_NS, WORLD, body_frame, layout

Floats = npt.NDArray[np.float32]

TICK_TOPICS = ("state", "reference", "imu", "actuators")
"""Topics with one message for each tick, all with its stamp."""


class Column(NamedTuple):
    """One column: a field of a topic; `item` is None for a single number."""

    topic: str
    field: str
    item: int | None


@dataclass(frozen=True, slots=True)
class Columns:
    """The columns that were read.

    Attributes:
        stamps_ns: shape (N,), rising.
        values: shape (N, columns).
        written_ns: stamp of the newest tick seen, 0 if there was none.
        ended: whether the file's end was reached, so that nothing will be added.
        damaged: number of chunks that could not be read.
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
        offset: of a record in the file before which there is no such tick.

    A tick counts when all topics of the columns have it. Raises UsageError or StorageError.
    """
    layouts = layouts_of(vehicle)
    columns = [parse_column(name, layouts) for name in names]
    topics = sorted({column.topic for column in columns} | {"state"})
    found = {topic: _Ticks(layouts[topic], start_ns, end_ns) for topic in topics}
    channels = _channels(path, vehicle, topics)
    reader = BlockReader(path, offset or len(MAGIC), CHUNK_BYTES)
    ended = False
    for block in reader:
        for channel, places in block.places.items():
            if channel in channels:
                found[channels[channel]].take(block, places)
        # Topics follow one another in the file: the slowest one decides.
        if min(one.newest_ns for one in found.values()) >= end_ns:
            break
        if min(one.count for one in found.values()) > rows:
            break
    else:
        ended = not reader.tear
    stamps = (one.stamps for one in found.values())
    common = reduce(np.intersect1d, stamps, np.unique(found["state"].stamps))[:rows]
    values = np.empty((len(common), len(columns)), np.float32)
    for j, (topic, field, item) in enumerate(columns):
        column = found[topic].at(common)[field]
        values[:, j] = column if item is None else column[:, item]
    written_ns = min(one.newest_ns for one in found.values())
    return Columns(common, values, written_ns, ended, reader.damaged_chunks)


class _Ticks:
    """The records of one topic between two stamps, inclusive."""

    def __init__(self, layout: FixedLayout, start_ns: int, end_ns: int) -> None:
        self._layout, self._start_ns, self._end_ns = layout, start_ns, end_ns
        self._parts = [np.zeros(0, layout.dtype)]
        self._stamps = [np.zeros(0, np.int64)]
        self.newest_ns = self.count = 0

    def take(self, block: Block, places: Places) -> None:
        size = self._layout.size
        places = places[field_at(block.data, places, LENGTH_AT, "<u8") == size + MESSAGE.size]
        if not len(places):
            return
        found = rows_at(block.data, places + HEAD_BYTES, size).view(self._layout.dtype)[:, 0]
        stamps = found["header.stamp.sec"].astype(np.int64) * SECOND_NS
        stamps += found["header.stamp.nanosec"]
        self.newest_ns = max(self.newest_ns, int(stamps[-1]))
        wanted = (stamps >= self._start_ns) & (stamps <= self._end_ns)
        self._parts.append(found[wanted])
        self._stamps.append(stamps[wanted])
        self.count += int(wanted.sum())

    @property
    def stamps(self) -> Stamps:
        return np.concatenate(self._stamps)

    def at(self, stamps: Stamps) -> npt.NDArray[np.void]:
        """Return the topic's record at each of these stamps."""
        return np.concatenate(self._parts)[np.searchsorted(self.stamps, stamps)]


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
