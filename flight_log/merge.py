"""A run's two logs merged: the station's recording, with the vehicle's own log in place of its
telemetry.

A message that both logs have comes from the vehicle's, in full precision; the station's stays where
the vehicle has none. A message is identified by its topic and the vehicle's stamp, which is
`publish_time` in both; for topics without one message per tick its bytes count too. The reception
time of a message of the vehicle's log is its stamp plus the usual delay of this run, which includes
the offset of the two clocks, but never outside the times of its neighbours of the same topic.
Neither log is changed, and the same logs always give the same bytes.
"""

from __future__ import annotations

import heapq
import json
import os
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np
from mcap.records import Attachment

from flight_log.columns.log_columns import read_columns
from flight_log.file import LogFile, sync_folder
from flight_log.mcap_writer import McapWriter
from flight_log.run_folder import MERGED, STATION, station_log, vehicle_logs
from flight_log.vehicle_messages import (
    EARLIEST,
    LATEST,
    Channel,
    Comparison,
    LogOverview,
    Selection,
    compare,
    joined,
)
from flight_log.writer import FILLED_METADATA, MEDIA_TYPES
from quadrotor.errors import LogFormatError, StorageError
from quadrotor.records import Stamps
from vehicle_link.topics.table import SHARED

LEAD_NS = 2_000_000_000
"""Nanoseconds by which the vehicle's log may begin before the run, as arming is received later."""
SLACK_NS = 2_000_000_000
"""Largest deviation, in ns, of the messages of a log from the order of their receptions."""


class Merge:
    """The plan of a merge: the source of each message. Raises LogFormatError, StorageError."""

    def __init__(self, run: Path) -> None:
        self.problems: list[str] = []
        self.station = LogOverview(station_log(run))
        self.delay_ns = self.station.delay_ns
        self.since_ns = self.station.first_ns - self.delay_ns
        self.until_ns = self.station.last_ns - self.delay_ns
        self.kept = {
            number: np.ones(len(one.keys), np.bool_)
            for number, one in self.station.channels.items()
        }
        taken: dict[str, list[Stamps]] = defaultdict(list)
        self.vehicle = [
            found
            for path in vehicle_logs(run)
            if (found := self._select(LogOverview(path), taken)) is not None
        ]
        for number, one in self.station.channels.items():
            if one.name in taken:
                self.kept[number] = ~np.isin(one.keys, np.concatenate(taken[one.name]))
        for source in self.vehicle:
            for number, its in source.log.channels.items():
                source.times[number] = self._receptions(its)

    def _select(self, log: LogOverview, taken: dict[str, list[Stamps]]) -> Selection | None:
        """Choose from one of the vehicle's logs, and add the keys to `taken`; return None for a log
        of another run.
        """
        first_ns, last_ns = log.span
        own = self.station.vehicle
        if own and log.vehicle not in ("", own):
            self.problems.append(f"{log.path.name} is of {log.vehicle}, not of {own}; left out")
            return None
        if first_ns > self.until_ns or last_ns < self.since_ns - LEAD_NS:
            self.problems.append(f"{log.path.name} has no tick of this run's time; left out")
            return None
        if log.reader.tear:
            self.problems.append(f"{log.path.name} {log.reader.tear}; read up to there")
        if log.reader.damaged_chunks:
            self.problems.append(f"{log.path.name} has {log.reader.damaged_chunks} damaged chunks")
        since_ns = self.since_ns
        if first_ns >= since_ns - LEAD_NS:  # else earlier messages belong to the previous run
            since_ns -= LEAD_NS
        found = Selection(log)
        for number, one in log.channels.items():
            mask = (one.stamps_ns >= since_ns) & (one.stamps_ns <= self.until_ns)
            first = np.zeros(len(mask), np.bool_)
            first[np.unique(one.keys, return_index=True)[1]] = True
            # A killed writer's last ticks may also be in the next file.
            mask &= first & ~np.isin(one.keys, joined(taken[one.name]))
            found.kept[number] = mask
            taken[one.name].append(one.keys[mask])
        return found

    def _receptions(self, messages: Channel) -> Stamps:
        """Return when the messages would have been received, ns of the station's clock."""
        usual: Stamps = messages.stamps_ns + self.delay_ns
        if messages.name in SHARED:  # the station's own have stamps of the station's clock
            return usual
        kept = [
            (one.stamps_ns[self.kept[number]], one.received_ns[self.kept[number]])
            for number, one in self.station.channels.items()
            if one.name == messages.name
        ]
        stamps, received = (joined([pair[k] for pair in kept]) for k in (0, 1))
        order = np.argsort(stamps, kind="stable")
        stamps, received = stamps[order], received[order]
        newest = np.maximum.accumulate(received)
        oldest = np.minimum.accumulate(received[::-1])[::-1]
        behind = np.searchsorted(stamps, messages.stamps_ns, side="right")
        earliest = np.concatenate([[EARLIEST], newest])[behind]
        latest = np.concatenate([oldest, [LATEST]])[behind] - 1
        # Neighbours that were received together leave no room between them.
        placed: Stamps = np.maximum(np.minimum(usual, latest), earliest)
        return placed

    def write(
        self, path: Path, metadata: Mapping[str, str], report: Callable[[float], None]
    ) -> int:
        """Write the merged log; return the number of its messages. Raises StorageError."""
        target = LogFile(path.with_name(f"{path.name}.new"), replace=True)
        try:
            writer = McapWriter(target)
            writer.start()
            reader = self.station.reader
            for name, values in reader.metadata.items():
                if name != FILLED_METADATA:
                    writer.add_metadata(name, values)
            writer.add_metadata(FILLED_METADATA, dict(metadata))
            for name, data in reader.attachments.items():
                kind = MEDIA_TYPES.get(Path(name).suffix, "")
                writer.add_attachment(Attachment(0, 0, name, kind, data))
            count = self._write_messages(writer, report)
            writer.finish()
            target.sync()
            os.replace(target.path, path)
            sync_folder(path.parent)
        except OSError as error:
            raise StorageError(f"cannot write {path}: {error.strerror}") from error
        finally:
            target.path.unlink(missing_ok=True)
            target.close()
        return count

    def _write_messages(self, writer: McapWriter, report: Callable[[float], None]) -> int:
        numbers = _Registered(writer)
        sources = [Selection(self.station, self.kept), *self.vehicle]
        streams = [_in_order(one, rank, numbers) for rank, one in enumerate(sources)]
        span = max(1, self.station.last_ns - self.station.first_ns)
        count = 0
        for log_ns, _, _, channel, stamp_ns, payload in heapq.merge(*streams):
            count += 1
            writer.add_message(channel, log_ns, payload, stamp_ns, count)
            if count % 10_000 == 0:
                report(min(1.0, max(0.0, (log_ns - self.station.first_ns) / span)))
        return count


class _Registered:
    """The channels of the merged log: one for each topic whose messages have the same
    description.
    """

    def __init__(self, writer: McapWriter) -> None:
        self._writer = writer
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._channels: dict[tuple[str, str, int], int] = {}

    def of(self, log: LogOverview, number: int) -> int | None:
        """Return the id in the merged log; None for a channel that the log does not describe."""
        channel = log.reader.channels.get(number)
        if channel is None:
            return None
        schema, id_ = log.reader.schemas.get(channel.schema_id), 0
        if schema is not None:
            described = (schema.name, schema.encoding, schema.data)
            if described not in self._schemas:
                self._schemas[described] = self._writer.register_schema(*described)
            id_ = self._schemas[described]
        key = (channel.topic, channel.message_encoding, id_)
        if key not in self._channels:
            self._channels[key] = self._writer.register_channel(*key, channel.metadata)
        return self._channels[key]


_Placed = tuple[int, int, int, int, int, bytes]
"""Log time, rank of the log, number in it, channel, stamp, payload."""


def _in_order(source: Selection, rank: int, numbers: _Registered) -> Iterator[_Placed]:
    """Yield the messages of a log in the order of their log time."""
    waiting: list[_Placed] = []
    newest, known = EARLIEST, {}
    messages = source.log.messages(source.kept, source.times, others=rank == 0)
    for count, (log_ns, number, stamp_ns, payload) in enumerate(messages):
        if number not in known:
            known[number] = numbers.of(source.log, number)
        channel = known[number]
        if channel is None:
            continue
        newest = max(newest, log_ns)
        heapq.heappush(waiting, (log_ns, rank, count, channel, stamp_ns, payload))
        while waiting[0][0] < newest - SLACK_NS:
            yield heapq.heappop(waiting)
    while waiting:
        yield heapq.heappop(waiting)


def merge(
    run: Path, oldest_on_board_ns: int = 0, report: Callable[[float], None] = lambda share: None
) -> Comparison:
    """Compare a run with the vehicle's logs in its folder, and merge them into one log, atomically;
    without any of the vehicle's logs nothing is written. The columns of the run are made too.

    Raises LogFormatError or StorageError.
    """
    plan = Merge(run)
    found = compare(plan.station, plan.vehicle, oldest_on_board_ns)
    found.problems += plan.problems
    if plan.vehicle:
        metadata = {
            "files": json.dumps([STATION, *(one.log.path.name for one in plan.vehicle)]),
            "messages": str(sum(int(m.sum()) for one in plan.vehicle for m in one.kept.values())),
            "seconds": f"{found.filled:.3f}",
            "missing_seconds": f"{found.missing:.3f}",
            "missing": found.why,
        }
        found.messages = plan.write(run / MERGED, metadata, report)
    with suppress(StorageError, LogFormatError):  # reported when the run is read
        read_columns(run)
    return found
