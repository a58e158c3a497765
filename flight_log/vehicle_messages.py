"""An overview of a log, and the comparison of a run with the vehicle's own logs: what was lost, and
what is still missing.
"""

from __future__ import annotations

import zlib
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flight_log.blocks import Block, BlockReader, Places, field_at
from flight_log.format import HEAD_BYTES, LENGTH_AT, LOG_AT, PUBLISH_AT
from flight_log.run_folder import station_log
from flight_log.tick_columns import TICK_TOPICS
from flight_log.writer import RUN_METADATA
from quadrotor.errors import LinkError
from quadrotor.records import Stamps
from vehicle_link.messages import decode
from vehicle_link.topics.table import TOPICS

FILLED_TOPICS = (
    *TICK_TOPICS,
    *(row.name for row in TOPICS.values() if row.sender == "vehicle" and row.recorded),
)
"""Topics whose messages are copied from the vehicle's log."""
EARLIEST, LATEST = -(2**62), 2**62

Mask = npt.NDArray[np.bool_]


class Channel(NamedTuple):
    """The messages of one channel, in the order of the file."""

    name: str  # of its topic, without the namespace
    stamps_ns: Stamps
    received_ns: Stamps
    keys: Stamps  # equal for the same message in two logs


class LogOverview:
    """An overview of a log: its times and which messages it has of the vehicle's topics."""

    def __init__(self, path: Path) -> None:
        """Read the log once. Raises LogFormatError or StorageError."""
        self.path = path
        self.armed: dict[int, bool] = {}  # by stamp
        self.delay_ns = 0  # reception minus the vehicle's stamp, median of this log
        self.first_ns, self.last_ns = LATEST, 0  # of reception
        self.reader = reader = BlockReader(path)
        parts: dict[int, list[tuple[Stamps, Stamps, Stamps]]] = defaultdict(list)
        offset_ns = 0
        for block in reader:
            for number, places in block.places.items():
                received = field_at(block.data, places, LOG_AT, "<u8").astype(np.int64)
                self.first_ns = min(self.first_ns, int(received.min()))
                self.last_ns = max(self.last_ns, int(received.max()))
                name = self._name(number)
                stamps = field_at(block.data, places, PUBLISH_AT, "<u8").astype(np.int64)
                if name in FILLED_TOPICS:
                    keys = stamps if name in TICK_TOPICS else _keys(block, places, stamps)
                    parts[number].append((stamps, received, keys))
                if name == "status":
                    self._look_for_armed(block, stamps, places)
                if name == "link_status":
                    with suppress(LinkError):
                        payload = _payload(block, int(places[-1]))
                        link_status = decode(payload, "quadlab_msgs/LinkStatus")
                        offset_ns = round(float(link_status.clock_offset) * 1e9)
        self.channels = {
            number: Channel(self._name(number), *map(np.concatenate, zip(*found, strict=True)))
            for number, found in parts.items()
        }
        states = [one for one in self.channels.values() if one.name == "state"]
        delays = [one.received_ns - one.stamps_ns for one in states]
        self.delay_ns = int(np.median(np.concatenate(delays))) if delays else -offset_ns
        self.vehicle = reader.metadata.get(RUN_METADATA, {}).get("vehicle", "")

    @property
    def span(self) -> tuple[int, int]:
        """Return the stamps of the first and last tick; without ticks, first > last."""
        stamps = stamps_of(self, "state")
        return int(stamps.min(initial=LATEST)), int(stamps.max(initial=EARLIEST))

    def messages(
        self, kept: Mapping[int, Mask], logs: Mapping[int, Stamps], *, others: bool
    ) -> Iterator[tuple[int, int, int, bytes]]:
        """Yield log time, channel, stamp and payload, nearly in the order of the log time.

        Args:
            kept: by channel, which messages.
            logs: by channel, their log times; channels without an entry keep those of the file.
            others: whether the messages of all other channels are yielded too.
        """
        at: Counter[int] = Counter()
        for block in BlockReader(self.path):
            found: list[tuple[int, int, int, int]] = []
            for number, places in block.places.items():
                its = slice(at[number], at[number] + len(places))
                at[number] = its.stop
                received = field_at(block.data, places, LOG_AT, "<u8").astype(np.int64)
                times = logs[number][its] if number in logs else received
                stamps = field_at(block.data, places, PUBLISH_AT, "<u8").astype(np.int64)
                if number not in kept and not others:
                    continue
                chosen = kept[number][its] if number in kept else np.ones(len(places), np.bool_)
                columns = (one[chosen].tolist() for one in (times, places, stamps))
                found += ((*row, number) for row in zip(*columns, strict=True))
            for time, place, stamp, number in sorted(found):
                yield time, number, stamp, _payload(block, place)

    def _name(self, number: int) -> str:
        channel = self.reader.channels.get(number)
        return channel.topic.rsplit("/", 1)[-1] if channel else ""

    def _look_for_armed(self, block: Block, stamps: Stamps, places: Places) -> None:
        with suppress(LinkError):  # of another version, with other fields
            for stamp_ns, place in zip(stamps.tolist(), places.tolist(), strict=True):
                status = decode(_payload(block, place), TOPICS["status"].type_name)
                self.armed[stamp_ns] = bool(status.armed)


@dataclass
class Selection:
    """The messages to copy from one of the vehicle's logs, by channel."""

    log: LogOverview
    kept: dict[int, Mask] = field(default_factory=dict)
    times: dict[int, Stamps] = field(default_factory=dict)  # on the station's clock


def vehicle_times(run: Path) -> tuple[int, int, int, int]:
    """Return the beginning and end of a run on the vehicle's clock, and the stamps of the first and
    last tick that the station has of it, in ns. Raises LogFormatError or StorageError.
    """
    log = LogOverview(station_log(run))
    return (log.first_ns - log.delay_ns, log.last_ns - log.delay_ns, *log.span)


def stamps_of(log: LogOverview, name: str, kept: Mapping[int, Mask] | None = None) -> Stamps:
    """Return the stamps of a topic in a log, (N,)."""
    return joined(
        [
            one.stamps_ns if kept is None else one.stamps_ns[kept[number]]
            for number, one in log.channels.items()
            if one.name == name
        ]
    )


def joined(parts: list[Stamps]) -> Stamps:
    return np.concatenate([np.zeros(0, np.int64), *parts])


def _keys(block: Block, places: Places, stamps: Stamps) -> Stamps:
    """Return a key for each message: its stamp and its bytes."""
    sums = [zlib.crc32(_payload(block, place)) for place in places.tolist()]
    return stamps ^ (np.array(sums, np.int64) << 30)


def _payload(block: Block, place: int) -> bytes:
    length = int.from_bytes(
        block.data[place + LENGTH_AT : place + LENGTH_AT + 8].tobytes(), "little"
    )
    return block.data[place + HEAD_BYTES : place + 9 + length].tobytes()


HOLE_PERIODS = 1.5
"""Number of usual periods between two ticks above which there is a hole."""
EDGE_NS = 150_000_000
"""Time from the vehicle's last tick, in ns, within which its log ends."""


@dataclass
class Comparison:
    """The comparison of a run with the vehicle's own log; times in s of ticks.

    Attributes:
        messages: number in the merged log; 0 when none was made.
        filled: ticks that only the vehicle's log has.
        missing: ticks that neither log has, though the vehicle flew them.
        total: ticks that the run would have without holes.
        ticks: number of ticks that it has.
        why: reason why ticks are missing.
        problems: of the vehicle's logs, a line each.
    """

    messages: int = 0
    filled: float = 0.0
    missing: float = 0.0
    total: float = 0.0
    ticks: int = 0
    why: str = ""
    problems: list[str] = field(default_factory=list)


def compare(
    station: LogOverview, taken: Sequence[Selection], oldest_on_board_ns: int
) -> Comparison:
    """Return the comparison of the run with the vehicle's own log.

    Args:
        oldest_on_board_ns: when the oldest log on board begins; 0 when there is none.
    """
    found = Comparison()
    before = _common([stamps_of(station, name) for name in TICK_TOPICS])
    after = _common(
        [
            np.concatenate(
                [stamps_of(station, name), *(stamps_of(one.log, name, one.kept) for one in taken)]
            )
            for name in TICK_TOPICS
        ]
    )
    ticks = before if len(before) > 1 else after
    period = int(np.median(np.diff(ticks))) if len(ticks) > 1 else 0
    missing, first_hole, is_armed = 0, 0, False
    steps = np.diff(after)
    for k in np.flatnonzero(steps > HOLE_PERIODS * period).tolist() if period else ():
        begin, end = int(after[k]), int(after[k + 1])
        armed = _is_armed_after(station, end)
        if not _is_known(taken, begin, end, armed):
            missing += max(1, round((end - begin) / period) - 1)
            first_hole = first_hole or begin
            is_armed = is_armed or armed
    seconds = period * 1e-9
    found.ticks = len(after)
    found.filled = (len(after) - len(before)) * seconds
    found.missing, found.total = missing * seconds, (len(after) + missing) * seconds
    if missing:
        if any(one.log.reader.damaged_chunks for one in taken):
            found.why = "the vehicle's log of it is damaged"
        elif oldest_on_board_ns > first_hole:
            found.why = "the vehicle's log of it was overwritten"
        elif not is_armed:
            found.why = "the vehicle was not armed, and logged nothing"
        else:
            found.why = "the vehicle has no log of it"
    return found


def _is_armed_after(station: LogOverview, stamp_ns: int) -> bool:
    """Return whether the vehicle was armed in the next status received."""
    after = (armed for stamp, armed in sorted(station.armed.items()) if stamp >= stamp_ns)
    return next(after, False)


def _is_known(taken: Sequence[Selection], begin: int, end: int, armed: bool) -> bool:
    """Return whether the vehicle's log shows that it has no ticks there either, as it logs only
    while it is armed.
    """
    for source in taken:
        first_ns, last_ns = source.log.span
        inside = first_ns <= begin and end <= last_ns
        if inside and not source.log.reader.damaged_chunks:
            return True
        is_end = last_ns < end and last_ns >= begin - EDGE_NS and not source.log.reader.tear
        if is_end and not armed:
            return True
    return False


def _common(topics: list[Stamps]) -> Stamps:
    """Return the stamps that all topics have, rising."""
    found = np.unique(topics[0])
    for stamps in topics[1:]:
        found = np.intersect1d(found, stamps)
    return found
