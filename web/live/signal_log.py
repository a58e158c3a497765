"""Everything that arrived of one vehicle in the last ten minutes, by the vehicle's time.

Zenoh's threads only queue what arrives; `take`, on the event loop, sorts it into the logs of the
topics. Times are s since `origin_ns`. They are of the vehicle's clock: a simulation that pauses or
runs slowly makes no hole. When that clock begins anew, so does everything here.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Collection
from functools import lru_cache
from typing import Protocol

import numpy as np

from quadrotor.errors import LinkError, LogFormatError, OutOfBoundsError
from quadrotor.records import Stamps
from vehicle_link.clock import monotonic
from vehicle_link.telemetry import Samples, unpack_samples
from vehicle_link.topics.ticks import TICK_TOPICS
from web.latest import STALE, TICKS, Stored
from web.live.growing import Growing
from web.live.topic_logs import MessageLog, TickLog, TickTopic
from web.signals import PLACES, UNITS
from web.signals.evaluator import Evaluator, Place, count_before
from web.signals.expression import Expression, is_expression, parse
from web.signals.functions import Step
from web.signals.signal import Array

SECOND_NS = 1_000_000_000
MOST_WAITING = 60_000
"""Number of messages that wait while the event loop is blocked."""
RESTART_NS = 5 * SECOND_NS
"""Stamps that go back by more belong to a vehicle whose clock began anew."""
OTHER_CLOCK = 0.5
"""Seconds from the vehicle's time above which the first stamp of a topic is of another clock. Later
ones of the vehicle's clock may come late, after this process stood still."""
PIECE = 8192
"""Number of a derived signal's samples that are computed at once."""


@lru_cache(256)
def expression_of(text: str) -> Expression:
    """Return the live derived signal of a text. Raises OutOfBoundsError."""
    return parse(text, UNITS)


Packet = tuple[Stamps, Samples]


class Log(Protocol):
    """Log of one topic, or of all that share their times."""

    time: Array
    dropped: int

    def missing(self, first: int, last: int) -> dict[int, int]: ...


class SignalLog(Evaluator):
    """The live log of a vehicle.

    Args:
        began_anew: called when the vehicle's clock began anew.
        clock: s, monotonic; of the simulation if there is one.
    """

    def __init__(
        self, began_anew: Callable[[], None] = lambda: None, clock: Callable[[], float] = monotonic
    ) -> None:
        self._logs: dict[str, TickTopic | MessageLog] = {}
        super().__init__(self._logs)
        self._began_anew, self._clock = began_anew, clock
        self._arrived: deque[Stored] = deque(maxlen=MOST_WAITING)
        self._kept: dict[str, _Kept] = {}
        self.origin_ns = 0
        self._newest: tuple[float, float] | None = None  # vehicle's time, clock
        self._has_ticks, self._foreign = False, set[str]()

    def put(self, message: Stored) -> None:
        """Queue a message; may be called from any thread."""
        self._arrived.append(message)

    @property
    def now(self) -> float:
        """Return the vehicle's time as it is by now, s since the origin."""
        if self._newest is None:
            return 0.0
        stamp, at = self._newest
        return stamp + self._clock() - at

    def take(self) -> None:
        """Sort in what has arrived."""
        packets: list[Packet] = []
        while self._arrived:
            message = self._arrived.popleft()
            if message.topic == TICKS:
                packets = self._take_packet(message, packets)
            else:
                self._take_message(message)
        self._add(packets)

    def log(self, topic: str) -> Log | None:
        """Return the log of a topic; None while nothing of it arrived."""
        found = self._logs.get(topic)
        return None if found is None else found.log

    def place(self, name: str) -> Place | Expression:
        if (place := PLACES.get(name)) is not None:
            return place
        if not is_expression(name):
            raise OutOfBoundsError(f"unknown signal {name!r:.80}; /api/signals lists them")
        return expression_of(name)

    def keep(self, expressions: Collection[str]) -> None:
        """Keep the samples of these derived signals and of no others, from the oldest input on."""
        gone = self._kept.keys() - set(expressions)
        self._kept = {name: one for name, one in self._kept.items() if name not in gone}
        for name in set(expressions) - self._kept.keys():
            self._kept[name] = _Kept(expression_of(name))

    def advance(self) -> None:
        """Compute the next samples of derived signals: of each at most PIECE."""
        for name, kept in self._kept.items():
            if (log := self.log(self.topic(name))) is None:
                continue
            begin = max(kept.end, log.dropped) - log.dropped
            end = min(self._settled_count(name), begin + PIECE)
            if end > begin:
                kept.extend(self.step(kept.expression, kept.step, begin, end), begin + log.dropped)
            kept.drop(log.dropped)

    def expression_values(self, expression: Expression, first: int, last: int) -> Array:
        kept, log = self._kept.get(expression.name), self.log(self.topic(expression.name))
        assert log is not None
        if kept is None:
            return self.step(expression, expression.start(), first, last)
        ahead = kept.begin - log.dropped
        rows: Array = kept.values.rows[max(0, first - ahead) : max(0, last - ahead)]
        return rows

    def formed(self, name: str) -> int:
        """Return how many samples of a signal there are whose inputs have all arrived."""
        log = self.log(self.topic(name))
        if log is None:
            return 0
        kept = self._kept.get(name)
        return max(0, kept.end - log.dropped) if kept else self._settled_count(name)

    def formed_at(self, name: str, times: Array) -> int:
        """Return at how many of a topic's times a signal is known, or will never be."""
        if self.times(name) is times:
            return self.formed(name)
        return count_before(times, self._settled(name, times))

    def _settled_count(self, name: str) -> int:
        place, times = self.place(name), self.times(name)
        inputs = place.inputs if isinstance(place, Expression) else place.source.inputs
        if not inputs:
            return len(times)
        return count_before(times, min(self._settled(one, times) for one in inputs))

    def _settled(self, name: str, times: Array) -> float:
        """Return until when an input has the samples that it will have."""
        topic = self.topic(name)
        log, place = self.log(topic), self.place(name)
        inputs = () if isinstance(place, Expression) else place.source.inputs
        of_inputs = (self._settled(one, times) for one in inputs)
        if log is None or not len(log.time):
            return min(self.now - STALE[topic], *of_inputs, math.inf)
        if log.time is times:
            return min(of_inputs, default=math.inf)
        newest = max(float(log.time[-1]), self.now - STALE[topic])
        return min(newest, *of_inputs, math.inf)

    def _take_packet(self, message: Stored, packets: list[Packet]) -> list[Packet]:
        try:
            _, stamps, samples = unpack_samples(message.payload)
        except LinkError:  # the station raises the alarm
            return packets
        newest = int(stamps[-1])
        before = None if self._newest is None else round(SECOND_NS * self._newest[0])
        if before is not None and newest - self.origin_ns < before - RESTART_NS:
            packets = []
            self._restart()
        self._start(newest)
        time = 1e-9 * (newest - self.origin_ns)
        if not self._has_ticks or self._newest is None or time > self._newest[0]:
            self._newest = time, message.received
        self._has_ticks = True
        packets.append((stamps, samples))
        return packets

    def _add(self, packets: list[Packet]) -> None:
        """Add ticks in the order of their stamps, each once."""
        if not packets:
            return
        if "state" not in self._logs:
            ticks = TickLog(self.origin_ns)
            self._logs |= {topic: TickTopic(ticks, topic) for topic in TICK_TOPICS}
        stamps = np.concatenate([one for one, _ in packets])
        unique, first = np.unique(stamps, return_index=True)
        log = self._logs["state"].log
        assert isinstance(log, TickLog)
        log.extend(unique, np.concatenate([one for _, one in packets])[first])

    def _take_message(self, message: Stored) -> None:
        if message.topic in TICK_TOPICS:  # of another node; the ticks are the vehicle's
            return
        if self._newest is None and not message.source_ns:
            return
        self._start(message.source_ns)
        time = 1e-9 * (message.source_ns - self.origin_ns)
        if self._newest is None:
            self._newest = time, message.received
        stamp, at = self._newest
        arrival = stamp + message.received - at
        if message.topic not in self._logs and abs(arrival - time) > OTHER_CLOCK:
            self._foreign.add(message.topic)
        if message.topic in self._foreign:
            time = arrival
        if not self._has_ticks and time > stamp:
            self._newest = time, message.received
        if message.topic not in self._logs:
            try:
                self._logs[message.topic] = MessageLog(message.topic)
            except LogFormatError:
                return
        log = self._logs[message.topic]
        assert isinstance(log, MessageLog)
        log.append(time, message.payload)

    def _start(self, stamp_ns: int) -> None:
        if not self.origin_ns:
            self.origin_ns = max(1, stamp_ns // SECOND_NS * SECOND_NS)

    def _restart(self) -> None:
        self._logs.clear()
        self.origin_ns, self._newest, self._has_ticks = 0, None, False
        self._kept = {name: _Kept(one.expression) for name, one in self._kept.items()}
        self._began_anew()


class _Kept:
    """Samples of a derived signal; `begin` and `end` count all of its topic that ever arrived."""

    def __init__(self, expression: Expression) -> None:
        self.expression = expression
        self.step: Step = expression.start()
        self.values = Growing(np.float64)
        self.begin = self.end = 0

    def extend(self, values: Array, begin: int) -> None:
        if not len(self.values):
            self.begin = begin
        self.values.extend(values)
        self.end = begin + len(values)

    def drop(self, until: int) -> None:
        if until > self.begin:
            self.values.drop(until - self.begin)
            self.begin = until
