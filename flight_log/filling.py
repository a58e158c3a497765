"""The messages that a run lacks of the vehicle's own log, and their places in the run.

A message that the run has stays as it is; one that it lacks comes from the vehicle's log. Its
reception is told as it would have been: the vehicle's stamp plus the run's usual delay, which
holds the offset of the two clocks, and never before or behind its neighbours of the same topic.
So stamps and receptions of a topic rise in the filled run as in any other.
"""

from __future__ import annotations

import heapq
import zlib
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flight_log.fill_source import Damage, FillSource, Onboard, chunks_of
from flight_log.run_index import RunIndex, TopicIndex, holes_of
from flight_log.tick_columns import TICK_TOPICS

SLACK_NS = 2_000_000_000
"""Messages of the vehicle's log lie at most so far from the order of their stamps."""
_EARLIEST, _LATEST = -(2**62), 2**62

Stamps = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]


class Placed(NamedTuple):
    """Sorts by when it stands in the run."""

    log_ns: int
    stamp_ns: int
    number: int
    message: Onboard


@dataclass(frozen=True)
class Stretch:
    """A stretch of one file on board that was looked at: its ticks there, and those the run has of
    them.
    """

    name: str
    first_ns: int
    last_ns: int
    ticks: int
    in_run: int  # between first and last, after filling


@dataclass
class Found:
    """The findings of a look: what the run lacks of the sources, and its state once that is filled
    in.

    Attributes:
        messages, ticks: to be filled in.
        holes: pairs of ticks between which some are missing still, as far as their stamps tell;
            and whether the vehicle was armed behind it, as far as the run tells.
        damaged: spans of the vehicle's log that cannot be read.
    """

    messages: int = 0
    ticks: int = 0
    period_ns: int = 0
    all_ticks: int = 0
    stretches: list[Stretch] = field(default_factory=list)
    holes: list[tuple[int, int, bool]] = field(default_factory=list)
    damaged: list[tuple[int, int]] = field(default_factory=list)


class Filling:
    """Args: the run's index; `since_ns` and `until_ns` of the vehicle's clock, both included:
    nothing outside is filled in."""

    def __init__(
        self, index: RunIndex, sources: Sequence[FillSource], since_ns: int, until_ns: int
    ) -> None:
        self._index, self._sources = index, sources
        self._since_ns, self._until_ns = since_ns, until_ns

    def look(self) -> Found:
        """Read the sources, changing nothing. Raises StorageError."""
        damage = Damage([])
        found = Found()
        missing: dict[str, list[Stamps]] = defaultdict(list)
        seen: dict[str, Stamps] = {}
        for source in self._sources:
            its: list[Stamps] = []
            for chunk in chunks_of(source, damage):
                for topic, group in _by_topic(chunk).items():
                    stamps = _stamps(group)
                    lacking = self._lacks(topic, group, stamps)
                    found.messages += int(lacking.sum())
                    if topic in TICK_TOPICS:
                        missing[topic].append(stamps[lacking])
                    if topic == "state":
                        its.append(stamps)
            seen[source.name] = np.unique(_all(its))
        lacked = [np.unique(_all(missing[topic])) for topic in TICK_TOPICS]
        after = self._ticks_after(lacked)
        found.all_ticks, found.ticks = len(after), len(after) - len(self._index.ticks)
        found.period_ns = self._index.period_ns or _period(after)
        found.holes = [
            (begin, end, self._index.is_armed_after(end))
            for begin, end in holes_of(after, found.period_ns)
        ]
        for name, stamps in seen.items():
            if len(stamps):
                first, last = int(stamps[0]), int(stamps[-1])
                inside = int(((after >= first) & (after <= last)).sum())
                found.stretches.append(Stretch(name, first, last, len(stamps), inside))
        found.damaged = damage.spans
        return found

    def _ticks_after(self, lacked: list[Stamps]) -> Stamps:
        after: Stamps | None = None
        for topic, new in zip(TICK_TOPICS, lacked, strict=True):
            had = self._index.topics.get(topic)
            its = np.union1d(had.stamps_ns, new) if had is not None else new
            after = its if after is None else np.intersect1d(after, its)
        assert after is not None
        return after

    def placed(self) -> Iterator[Placed]:
        """Yield what the run lacks, in the order in which it is to be placed there. Raises
        StorageError.
        """
        waiting: list[Placed] = []
        taken: set[tuple[str, int, bytes]] = set()  # of OTHER_TOPICS: the same twice on board
        number, newest = 0, _EARLIEST
        reached: dict[str, int] = {}
        for source in self._sources:
            # A killed writer's last ticks may stand in the next file too.
            behind = dict(reached)
            for chunk in chunks_of(source, Damage([])):
                for topic, group in _by_topic(chunk).items():
                    stamps = _stamps(group)
                    lacking = self._lacks(topic, group, stamps)
                    if topic in TICK_TOPICS:
                        lacking &= stamps > behind.get(topic, _EARLIEST)
                        reached[topic] = max(reached.get(topic, _EARLIEST), int(stamps.max()))
                    if not lacking.any():
                        continue
                    logs = self._receptions(topic, stamps)
                    for k in np.flatnonzero(lacking).tolist():
                        message = group[k]
                        if topic not in TICK_TOPICS:
                            key = (topic, message.stamp_ns, message.payload)
                            if key in taken:
                                continue
                            taken.add(key)
                        number += 1
                        log_ns = int(logs[k])
                        newest = max(newest, log_ns)
                        heapq.heappush(waiting, Placed(log_ns, message.stamp_ns, number, message))
                while waiting and waiting[0].log_ns < newest - SLACK_NS:
                    yield heapq.heappop(waiting)
        while waiting:
            yield heapq.heappop(waiting)

    def _lacks(self, topic: str, group: list[Onboard], stamps: Stamps) -> Mask:
        wanted: Mask = (stamps >= self._since_ns) & (stamps <= self._until_ns)
        had = self._index.topics.get(topic)
        if had is None or not len(had.stamps_ns):
            return wanted
        if topic in TICK_TOPICS:
            places = np.minimum(np.searchsorted(had.stamps_ns, stamps), len(had.stamps_ns) - 1)
            wanted &= had.stamps_ns[places] != stamps
        else:
            keys = [(one.stamp_ns, zlib.crc32(one.payload)) for one in group]
            wanted &= np.array([key not in had.sums for key in keys])
        return wanted

    def _receptions(self, topic: str, stamps: Stamps) -> Stamps:
        """Return the reception times these stamps would have had, ns of the station's clock."""
        usual = stamps + self._index.delay_ns
        had = self._index.topics.get(topic, _NOTHING)
        behind = np.searchsorted(had.stamps_ns, stamps, side="right")
        earliest = np.concatenate([[_EARLIEST], had.placed_ns])[behind]
        latest = np.concatenate([had.received_ns, [_LATEST]])[behind] - 1
        # Where neighbours were received at once there is no room between them.
        placed: Stamps = np.maximum(np.minimum(usual, latest), earliest)
        return placed


_NONE = np.zeros(0, np.int64)
_NOTHING = TopicIndex(_NONE, _NONE, _NONE)


def _by_topic(chunk: list[Onboard]) -> dict[str, list[Onboard]]:
    groups: dict[str, list[Onboard]] = defaultdict(list)
    for one in chunk:
        groups[one.topic].append(one)
    return groups


def _stamps(group: list[Onboard]) -> Stamps:
    return np.array([one.stamp_ns for one in group], np.int64)


def _all(parts: list[Stamps]) -> Stamps:
    return np.concatenate(parts) if parts else np.zeros(0, np.int64)


def _period(ticks: Stamps) -> int:
    return int(np.median(np.diff(ticks))) if len(ticks) > 1 else 0
