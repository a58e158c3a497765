"""An index of what a run has of the vehicle's topics, and where ticks are missing.

A message is known by its topic and the vehicle's stamp, which is `publish_time` in the station's
recording as in the vehicle's own log; of topics without one message a tick its bytes count too.
"""

from __future__ import annotations

import zlib
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
from mcap.records import Channel, Schema

from flight_log.blocks import Block, BlockReader, field_at
from flight_log.format import HEAD_BYTES, LENGTH_AT, LOG_AT, PUBLISH_AT
from flight_log.tick_columns import TICK_TOPICS
from flight_log.writer import RUN_METADATA
from quadrotor.errors import LinkError, LogFormatError
from vehicle_link.messages import decode
from vehicle_link.topics.table import TOPICS

Stamps = npt.NDArray[np.int64]

OTHER_TOPICS = tuple(
    row.name for row in TOPICS.values() if row.sender == "vehicle" and row.recorded
)
"""The vehicle's besides those of every tick."""
FILLED_TOPICS = (*TICK_TOPICS, *OTHER_TOPICS)
REGULAR_TOPICS = tuple(name for name in OTHER_TOPICS if TOPICS[name].rate)
AT_TIMES = ("bearing_pose",)
"""The vehicle itself has long pauses of these: a gap above PAUSE_NS is one."""
PAUSE_NS = 1_000_000_000
HOLE_PERIODS = 1.5
"""Two ticks further apart than so many usual periods have a hole between them."""


@dataclass
class TopicIndex:
    """An index of one topic, in the order of the stamps.

    Attributes:
        stamps_ns: the vehicle's, shape (N,).
        placed_ns: when it stands in the file, ns of the station's clock, shape (N,): the newest
            reception up to there, for receptions of several topics cross by a hair.
        received_ns: shape (N,).
        sums: of the payloads, with their stamps; empty for topics of every tick.
    """

    stamps_ns: Stamps
    placed_ns: Stamps
    received_ns: Stamps
    sums: set[tuple[int, int]] = field(default_factory=set)


@dataclass
class RunIndex:
    """Times of the station's clock are `…_received_ns`, all others the vehicle's.

    Attributes:
        vehicle: namespace of the topics.
        topics: by name without it, those of FILLED_TOPICS that the run has.
        ticks: stamps that all topics of a tick have, shape (N,), rising.
        delay_ns: reception on the station's clock minus the vehicle's stamp, as usual in this run:
            minus the clocks' offset plus the way.
        armed: stamp → whether the vehicle said so in its status, in order.
        metadata: all records of the file.
        channels, schemas: of the file, by id.
    """

    vehicle: str
    topics: dict[str, TopicIndex]
    ticks: Stamps
    delay_ns: int
    first_received_ns: int
    last_received_ns: int
    armed: dict[int, bool]
    metadata: dict[str, dict[str, str]]
    channels: dict[int, Channel]
    schemas: dict[int, Schema]

    @property
    def period_ns(self) -> int:
        """Return the usual time between two ticks, in ns; 0 when there are fewer than two."""
        return int(np.median(np.diff(self.ticks))) if len(self.ticks) > 1 else 0

    def holes(self) -> list[tuple[int, int]]:
        """Return pairs of neighbouring ticks with others missing in between, in order."""
        return holes_of(self.ticks, self.period_ns)

    def is_armed_after(self, stamp_ns: int) -> bool:
        """Return whether the vehicle was armed in the next status received."""
        after = [armed for stamp, armed in self.armed.items() if stamp >= stamp_ns]
        return bool(after) and after[0]

    def gaps(self) -> list[tuple[int, int]]:
        """Return spans in which messages of the other topics seem to be missing, in no order."""
        found = []
        for name in REGULAR_TOPICS:
            stamps = self.topics[name].stamps_ns if name in self.topics else np.zeros(0, np.int64)
            if len(stamps) < 2:
                continue
            half = int(np.median(np.diff(stamps))) // 2
            for before, after in holes_of(stamps, 2 * half):
                if name not in AT_TIMES or after - before <= PAUSE_NS:
                    found.append((before + half, after - half))
        return found


def holes_of(ticks: Stamps, period_ns: int) -> list[tuple[int, int]]:
    if not period_ns:
        return []
    places = np.flatnonzero(np.diff(ticks) > HOLE_PERIODS * period_ns)
    return [(int(ticks[k]), int(ticks[k + 1])) for k in places]


def index_run(path: Path) -> RunIndex:
    """Read it once. Raises LogFormatError or StorageError; a torn run is to be mended first."""
    reader = BlockReader(path)
    parts: dict[str, list[tuple[Stamps, Stamps, Stamps]]] = {}
    sums: dict[str, set[tuple[int, int]]] = {}
    newest = first = last = 0
    offset_ns: int | None = None
    armed: dict[int, bool] = {}
    for block in reader:
        order = np.sort(np.concatenate(list(block.places.values())))
        received = field_at(block.data, order, LOG_AT, "<u8").astype(np.int64)
        first = int(received.min()) if not first else min(first, int(received.min()))
        last = max(last, int(received.max()))
        placed = np.maximum(np.maximum.accumulate(received), newest)
        newest = int(placed[-1])
        for channel_id, places in block.places.items():
            channel = reader.channels.get(channel_id)
            name = channel.topic.rsplit("/", 1)[-1] if channel else ""
            if name == "link_status":
                offset_ns = _offset(block, int(places[-1]))
            if name not in FILLED_TOPICS:
                continue
            stamps = field_at(block.data, places, PUBLISH_AT, "<u8").astype(np.int64)
            where = np.searchsorted(order, places)
            parts.setdefault(name, []).append((stamps, placed[where], received[where]))
            if name in OTHER_TOPICS:
                payloads = (zlib.crc32(_payload(block, int(place))) for place in places)
                if name == "status":
                    armed |= _armed(block, stamps, places)
                sums.setdefault(name, set()).update(zip(stamps.tolist(), payloads, strict=True))
    if reader.tear:
        raise LogFormatError(f"{path.name} is torn: it {reader.tear}; try: quadlab log recover")
    topics = {name: _joined(found, sums.get(name, set())) for name, found in parts.items()}
    vehicle = reader.metadata.get(RUN_METADATA, {}).get("vehicle", "")
    return RunIndex(
        vehicle,
        topics,
        _ticks(topics),
        _delay(topics, offset_ns),
        first,
        last,
        dict(sorted(armed.items())),
        reader.metadata,
        reader.channels,
        reader.schemas,
    )


def _joined(parts: list[tuple[Stamps, Stamps, Stamps]], sums: set[tuple[int, int]]) -> TopicIndex:
    stamps, placed, received = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(stamps, kind="stable")
    return TopicIndex(stamps[order], placed[order], received[order], sums)


def _ticks(topics: dict[str, TopicIndex]) -> Stamps:
    found: Stamps | None = None
    for name in TICK_TOPICS:
        its = topics[name].stamps_ns if name in topics else np.zeros(0, np.int64)
        found = np.unique(its) if found is None else np.intersect1d(found, its)
    assert found is not None
    return found


def _delay(topics: dict[str, TopicIndex], offset_ns: int | None) -> int:
    state = topics.get("state")
    if state is not None and len(state.stamps_ns):
        return int(np.median(state.received_ns - state.stamps_ns))
    return -(offset_ns or 0)


def _armed(block: Block, stamps: Stamps, places: Stamps) -> dict[int, bool]:
    """Return whether the vehicle was armed, by stamp; empty for a run of another version, whose
    messages have other fields.
    """
    found = {}
    with suppress(LinkError):
        for stamp_ns, place in zip(stamps.tolist(), places.tolist(), strict=True):
            status = decode(_payload(block, place), "quadlab_msgs/VehicleStatus")
            found[stamp_ns] = bool(status.armed)
    return found


def _offset(block: Block, place: int) -> int:
    """Return the vehicle's clock minus the station's, ns, as the link measured it."""
    with suppress(LinkError):
        message = decode(_payload(block, place), "quadlab_msgs/LinkStatus")
        return round(float(message.clock_offset) * 1e9)
    return 0


def _payload(block: Block, place: int) -> bytes:
    length = int(field_at(block.data, np.array([place]), LENGTH_AT, "<u8")[0])
    return block.data[place + HEAD_BYTES : place + 9 + length].tobytes()
