"""Messages of a topic of the last ten minutes, as columns that are named as in a log."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from flight_log.payload_columns import Column, PayloadColumns, schema_of
from quadrotor.errors import OutOfBoundsError
from quadrotor.records import Stamps
from vehicle_link.messages.cdr_layout import Records
from vehicle_link.telemetry import FLOATS, Samples, ticks_of
from vehicle_link.topics.table import TOPICS
from vehicle_link.topics.ticks import TICK_TOPICS
from web.latest import STALE
from web.live.growing import Growing
from web.signals.evaluator import count_before
from web.signals.signal import Array

KEPT = 600.0
"""Seconds for which everything is kept."""
KEPT_BYTES = 24_000_000
"""Bytes of a topic's messages that are kept at most: of a simulator's truth five minutes."""
MOST_MEMBERS = 16
"""Most estimators of the topic `comparison`."""
USUAL_OF = 500
"""Number of newest ticks whose median period is the usual one."""
LOST = 1.5
"""Usual periods above which a tick is missing."""


class TickLog:
    """The vehicle's ticks.

    Args:
        origin_ns: the stamp from which times are counted.

    Attributes:
        time: of each tick, s, (N,); the same array until more are added.
        dropped: number of ticks that were kept before, and no longer are.
    """

    def __init__(self, origin_ns: int) -> None:
        self._origin_ns = origin_ns
        self._times, self._stamps = Growing(np.float64), Growing(np.int64)
        self._samples = Growing(np.float32, FLOATS)
        self._read: dict[tuple[str, int, int], Records] = {}
        self.time: Array = self._times.rows
        self.dropped = 0

    def extend(self, stamps_ns: Stamps, samples: Samples) -> None:
        """Add the ticks that are newer than all before; they are in order."""
        self._read.clear()
        if len(self._stamps):
            fresh = stamps_ns > self._stamps.rows[-1]
            stamps_ns, samples = stamps_ns[fresh], samples[fresh]
        self._stamps.extend(stamps_ns)
        self._times.extend(1e-9 * (stamps_ns - self._origin_ns))
        self._samples.extend(samples)
        times = self._times.rows
        count = count_before(times, times[-1] - KEPT) if len(times) else 0
        for one in (self._times, self._stamps, self._samples):
            one.drop(count)
        self.dropped += count
        self.time = self._times.rows

    @property
    def stamps_ns(self) -> Stamps:
        """Return the stamp of each tick, (N,), the same until more are added."""
        return self._stamps.rows

    def period(self) -> float:
        """Return the usual time between two ticks, s."""
        newest = self.time[-USUAL_OF:]
        return float(np.median(np.diff(newest))) if len(newest) > 1 else np.inf

    def missing(self, first: int, last: int) -> dict[int, int]:
        """Return how many ticks are missing before each tick `first` <= index < `last`, if any."""
        begin = max(first - 1, 0)
        periods = np.diff(self.time[begin:last]) / self.period()
        places = np.flatnonzero(periods > LOST)
        return {begin + k + 1: round(periods[k]) - 1 for k in places.tolist()}

    def values(self, name: str, first: int, last: int) -> npt.NDArray[np.generic]:
        """Return a column, named `TOPIC/COLUMN`, of the ticks `first` to `last` - 1."""
        topic, _, path = name.partition("/")
        records = self.records(topic, first, last)
        if path in (records.dtype.names or ()):
            return records[path]
        found = re.fullmatch(r"(.+?)(?:\.([xyzw])|\[(\d+)\])", path)
        if found is None or found[1] not in (records.dtype.names or ()):
            raise OutOfBoundsError(f"{topic} has no {path!r:.80} that changes")
        index = "xyzw".index(found[2]) if found[2] else int(found[3])
        return records[found[1]][:, index]

    def records(self, topic: str, first: int, last: int) -> Records:
        """Return ticks as messages of a topic; the same for each column that is asked for."""
        key = (topic, first, last)
        if key not in self._read:
            if len(self._read) > 2 * len(TICK_TOPICS):
                self._read.clear()
            stamps, samples = self._stamps.rows[first:last], self._samples.rows[first:last]
            self._read[key] = TICK_TOPICS[topic](ticks_of(stamps, samples))
        return self._read[key]


class TickTopic:
    """One topic of the ticks; all share their times."""

    def __init__(self, ticks: TickLog, topic: str) -> None:
        self.log, self._topic = ticks, topic

    @property
    def time(self) -> Array:
        return self.log.time

    def values(self, name: str, first: int, last: int) -> npt.NDArray[np.generic]:
        return self.log.values(f"{self._topic}/{name}", first, last)


class MessageLog:
    """The messages of another topic; a column `NAME/PATH` is that of the estimator of this name.

    Attributes:
        time: of each message, s, (N,); the same array until more are added.
        dropped: number of messages that were kept before, and no longer are.
    """

    def __init__(self, topic: str) -> None:
        self._columns = PayloadColumns(schema_of(TOPICS[topic].type_name))
        self._deadline = STALE[topic]
        self._times, self._payloads = Growing(np.float64), Growing(np.object_)
        self.time: Array = self._times.rows
        self._bytes = self.dropped = 0
        self._asked: set[str] = set()
        self._range, self._read = (0, 0), dict[str, Column]()

    @property
    def log(self) -> MessageLog:
        return self

    def append(self, time: float, payload: bytes) -> None:
        """Add a message if it is newer than all before."""
        if len(self._times) and time <= self.time[-1]:
            return
        self._range = (0, 0)
        self._times.extend([time])
        self._payloads.extend(np.array([payload], np.object_))
        self._bytes += len(payload)
        while self._bytes > KEPT_BYTES or self._times.rows[0] < time - KEPT:
            self._bytes -= len(self._payloads.rows[0])
            self._times.drop(1)
            self._payloads.rows[0] = None
            self._payloads.drop(1)
            self.dropped += 1
        self.time = self._times.rows

    def missing(self, first: int, last: int) -> dict[int, int]:
        """Return the messages before which nothing came for longer than the deadline, each with 0:
        it is not known how many there should have been.
        """
        begin = max(first - 1, 0)
        holes = np.flatnonzero(np.diff(self.time[begin:last]) > self._deadline)
        return dict.fromkeys((begin + 1 + holes).tolist(), 0)

    def values(self, name: str, first: int, last: int) -> npt.NDArray[np.generic]:
        """Return a column of the messages `first` to `last` - 1."""
        member, _, path = name.rpartition("/")
        places = [f"estimators[{k}]." for k in range(MOST_MEMBERS)] if member else []
        wanted = [path] if not member else [one + end for one in places for end in ("name", path)]
        found = self._columns_of(first, last, wanted)
        values = np.full(last - first, np.nan)
        if not member:
            return found.get(path, values)
        for place in places:
            if place + "name" not in found:
                break
            mine = found[place + "name"] == member
            values[mine] = found.get(place + path, values)[mine]
        return values

    def _columns_of(self, first: int, last: int, wanted: Sequence[str]) -> dict[str, Column]:
        """Return columns; all that were asked for before are read at once."""
        if (first, last) != self._range or not self._asked.issuperset(wanted):
            self._asked.update(wanted)
            payloads: list[bytes] = self._payloads.rows[first:last].tolist()
            self._range, self._read = (first, last), self._columns.read(payloads, self._asked)
        return self._read
