"""A run: its topics in the order of their time, on one clock that begins with the run; and the gaps
of a topic.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from flight_log.columns.log_columns import LogColumns, read_columns
from flight_log.columns.topic import Topic
from flight_log.topic_columns import text_fields
from quadrotor.errors import LogFormatError
from quadrotor.records import Stamps

OTHER_CLOCK = 500_000_000
"""Median delay, in ns, above which a source's clock counts as different from the recorder's."""
STEPPED = 5_000_000_000
"""Variation of the delay, in ns, above which the source's stamps are not used."""
GAP_PERIODS = 4.0
SHORTEST_GAP = 0.05  # s
MAX_GAPS = 20_000
PIECE = 100_000
"""Number of stamps that are converted at once."""


def common_stamps(log_ns: Stamps, publish_ns: Stamps) -> Stamps:
    """Return when each message was valid, ns of the recorder's clock, shape (N,).

    The source's stamps are more precise (five samples arrive in one packet). The clock of a vehicle
    that differs from the recorder's is converted by the shortest delay seen.
    """
    delay = log_ns - publish_ns
    shortest = delay.min()
    if not publish_ns.any() or int(delay.max() - shortest) > STEPPED:
        return log_ns
    if abs(float(np.median(delay, overwrite_input=True))) < OTHER_CLOCK:
        return publish_ns
    del delay  # in a long log as large as the stamps
    moved: Stamps = publish_ns + shortest
    return moved


def gaps(times: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    """Return the indices after which a topic was silent for unusually long, shape (G,)."""
    if len(times) < 3:
        return np.zeros(0, np.int64)
    usual = float(np.median(np.diff(times), overwrite_input=True))
    limit = max(GAP_PERIODS * usual, SHORTEST_GAP)
    return np.flatnonzero(np.diff(times) > limit)[:MAX_GAPS]


def seconds_since(stamps_ns: Stamps, start_ns: int) -> npt.NDArray[np.float64]:
    """Return the seconds (N,); piece by piece, so that a long log's stamps are held only twice."""
    out = np.empty(len(stamps_ns))
    for begin in range(0, len(out), PIECE):
        piece = slice(begin, begin + PIECE)
        out[piece] = (stamps_ns[piece] - start_ns).astype(np.float64) / 1e9
    return out


MAX_MESSAGES = 12_000_000
"""Largest number of messages of a run, whose times and order are held in memory."""

Floats = npt.NDArray[np.float32]
Times = npt.NDArray[np.float64]


class Series:
    """N messages of one topic in the order of their time.

    Args:
        time: of each message in the topic's order, s, shape (N,); it is sorted in place.

    Attributes:
        time: the sorted times.
    """

    def __init__(self, topic: Topic, time: Times) -> None:
        self.type_name = topic.type_name
        self._topic = topic
        rises = bool((time[1:] >= time[:-1]).all())
        # For ten million messages each 64-bit array has 80 MB; MAX_MESSAGES fit in 32 bits.
        self._order = None if rises else np.argsort(time, kind="stable").astype(np.int32)
        if not rises:
            time.sort(kind="stable")
        self.time = time

    def __len__(self) -> int:
        return len(self.time)

    def __contains__(self, name: str) -> bool:
        return name in self._topic

    @property
    def names(self) -> list[str]:
        """Return the names of its numbers."""
        return self._topic.names

    def constant(self, name: str) -> float | None:
        """Return a number's only value; NaN if it has none, None if it has several."""
        found = self._topic.constants.get(name)
        return None if found is None else float(np.array(found, self._topic.dtype))

    def values(self, name: str, first: int = 0, last: int | None = None) -> Floats:
        """Return one number of the messages `first` to `last` - 1, (N,), NaN if missing.

        The array is read-only.
        """
        if self._order is None:
            return self._topic.values(name, first, last)
        return self._topic.values(name)[self._order[first:last]]

    def rows(self, names: Sequence[str]) -> Floats:
        """Return numbers, (N, len(names)), NaN where the log has none."""
        return np.stack([self.values(name) for name in names], axis=1)

    def take(self, names: Sequence[str]) -> Floats:
        """Return the same as `rows`, but read the columns one after the other."""
        rows = self._topic.take(names)
        return rows if self._order is None else rows[self._order]

    def table(self, names: Sequence[str], start: float, end: float) -> Times:
        """Return (M, len(names)) for start <= t <= end; NaN for a number that is not in the log."""
        inside = (self.time >= start) & (self.time <= end)
        columns = [self.values(name)[inside].astype(np.float64) for name in names]
        return np.stack(columns, axis=1)

    @property
    def texts(self) -> dict[str, list[tuple[float, str]]]:
        """Return the changes of every text by path: time (s) and new text."""
        return {path: self.changes(path) for path in self._topic.texts}

    def changes(self, path: str) -> list[tuple[float, str]]:
        """Return the changes of one text, in order; empty if the log has no such text."""
        texts = self._topic.texts.get(path, [])
        if self._order is None:
            return [(float(self.time[index]), text) for index, text in texts]
        place = np.argsort(self._order)
        return sorted((float(self.time[place[index]]), text) for index, text in texts)

    def lines(self, most: int) -> Iterator[tuple[float, dict[str, Any]]]:
        """Yield time (s) and fields of the `most` messages logged first; payloads must be stored.

        Messages of the same instant stay in the order of the log: a mark's later text has the same
        stamp.
        """
        payloads = self._topic.payloads[:most]
        order = range(len(self.time)) if self._order is None else self._order.tolist()
        for time, index in zip(self.time.tolist(), order, strict=True):
            if index < len(payloads):
                yield time, text_fields(payloads[index], self._topic.decodable_name)

    def payload(self, index: int) -> bytes:
        """Return one message of a topic with stored payloads, by its index in time order."""
        return self._topic.payload(index if self._order is None else int(self._order[index]))

    @property
    def gaps(self) -> list[tuple[float, float]]:
        """Return start and length (s) of the topic's gaps."""
        return [
            (float(self.time[k]), float(self.time[k + 1] - self.time[k])) for k in gaps(self.time)
        ]


@dataclass
class Run:
    """A run with its topics. Times are s since its first message.

    Attributes:
        space: namespace of the vehicle that the run is about.
        start_ns: time of the first message, on the recorder's clock.
        topics: by name without that namespace; topics of the same ticks share their `time`.
        log: attachments, metadata and damage of the file.
    """

    space: str
    start_ns: int
    topics: dict[str, Series]
    log: LogColumns

    @property
    def duration(self) -> float:
        """Return the time of the last message, s."""
        return max(float(one.time[-1]) for one in self.topics.values())


def read_run(log: Path, progress: Callable[[float], None] = lambda share: None) -> Run:
    """Read a run; `progress` as for `read_columns`. Raises as it does; LogFormatError also when it
    has no messages, or too many.
    """
    return run_of(read_columns(log, progress))


def run_of(columns: LogColumns) -> Run:
    """Return the run of a log's columns. Raises LogFormatError as `read_run` does."""
    found = columns.topics
    if not found:
        unread = next(iter(columns.problems.items()), None)
        why = f"{unread[0]}: {unread[1]}" if unread else f"it {columns.tear or 'has no message'}"
        raise LogFormatError(f"{columns.path.name} has nothing to show: {why}")
    if (count := sum(map(len, found.values()))) > MAX_MESSAGES:
        raise LogFormatError(
            f"{columns.path.name} has {count} messages; at most {MAX_MESSAGES} are shown: cut it "
            "with `mcap filter --include-attachments --output-compression lz4 --start … --end …`, "
            "or export it with `quadlab log export`"
        )
    space = _namespace(found)
    stamps = {name: common_stamps(one.log_ns, one.publish_ns) for name, one in found.items()}
    start_ns = min(int(one.min()) for one in stamps.values())
    topics: dict[str, Series] = {}
    for name, topic in found.items():
        time = seconds_since(stamps.pop(name), start_ns)
        topic.release()
        series = Series(topic, time)
        del time
        known = (one.time for one in topics.values() if np.array_equal(one.time, series.time))
        series.time = next(known, series.time)
        topics[name.removeprefix(f"{space}/").lstrip("/")] = series
    return Run(space, start_ns, topics, columns)


def _namespace(topics: dict[str, Topic]) -> str:
    """Return the vehicle's namespace: that of the state, else that of most messages."""
    counts: dict[str, int] = {}
    for topic, one in topics.items():
        space, _, name = topic.rpartition("/")
        counts[space] = counts.get(space, 0) + len(one) + (10**12 if name == "state" else 0)
    return max(counts, key=lambda space: counts[space])
