"""Newest message of each topic and its age.

Zenoh's threads store payloads; the page's loops read messages at their own pace, so that what no
page shows is never decoded. Ages use this computer's monotonic clock, from the arrival, and so need
no clock of the vehicle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, cast

from quadrotor.records import Record
from vehicle_link.clock import monotonic
from vehicle_link.messages.records import Message
from vehicle_link.telemetry import unpack
from vehicle_link.topics.table import TOPICS
from vehicle_link.topics.ticks import TICK_TOPICS

if TYPE_CHECKING:
    from vehicle_link.topics.typed_tables import Newest

STALE = {name: row.stale for name, row in TOPICS.items() if row.stale}
"""Topics whose newest message is stored.

The value is the age, in s, above which its values are shown in grey and charts show a gap.
"""

FAST = frozenset(name for name in STALE if TOPICS[name].page != "always")
"""Topics that arrive many times a second, or are computed only while shown."""

CHARTED = tuple(name for name in STALE if TOPICS[name].page == "chart")
"""Topics that only charts need."""


TICKS = "ticks"
"""Topic of whole packets of telemetry, by which all of TICK_TOPICS are received."""


class Stored(NamedTuple):
    """One message as it arrived."""

    topic: str
    payload: bytes
    source_ns: int
    received: float  # s, monotonic


@dataclass(slots=True)
class _Packet:
    """A packet of telemetry, and its newest tick once a topic of it was asked for."""

    payload: bytes
    tick: Record | None = None


@dataclass(slots=True)
class _Newest:
    payload: bytes
    received: float  # s, monotonic
    message: Message | None = None
    packet: _Packet | None = None  # of which the payload is still to be made


class Live:
    """Newest messages of one vehicle.

    Args:
        decode: called as `decode(payload, type_name)`; returns the message.
        clock: s, monotonic.
        also: called with each message too, on the same thread.
    """

    def __init__(
        self,
        decode: Callable[[bytes, str], Message],
        clock: Callable[[], float] = monotonic,
        also: Callable[[Stored], None] = lambda message: None,
    ) -> None:
        self._decode = decode
        self._clock = clock
        self._also = also
        self._newest: dict[str, _Newest] = {}
        self.newest = cast("Newest", self._decoded)
        """Return the newest message whatever its age, decoded once; None before the first."""
        self.current = cast("Newest", self._current)
        """Return the newest message, or None when it is stale."""

    def put(self, topic: str, payload: bytes, source_ns: int = 0) -> None:
        """Store a message; may be called from any thread.

        Of a packet of telemetry, the newest tick is the newest message of each of TICK_TOPICS,
        unless `source_ns` is 0: then it arrived late.
        """
        received = self._clock()
        self._also(Stored(topic, payload, source_ns, received))
        if topic != TICKS:
            self._newest[topic] = _Newest(payload, received)
        elif source_ns:
            packet = _Packet(payload)
            made = {name: _Newest(b"", received, packet=packet) for name in TICK_TOPICS}
            self._newest.update(made)

    def age(self, topic: str) -> float:
        """Return the seconds since the newest message arrived; inf before the first."""
        newest = self._newest.get(topic)
        return self._clock() - newest.received if newest else float("inf")

    def fresh(self, topic: str) -> bool:
        return self.age(topic) <= STALE[topic]

    def _decoded(self, topic: str) -> Message | None:
        newest = self._newest.get(topic)
        if newest is None:
            return None
        if (packet := newest.packet) is not None:
            if packet.tick is None:
                packet.tick = unpack(packet.payload)[1][-1:]
            newest.payload, newest.packet = TICK_TOPICS[topic](packet.tick).tobytes(), None
        if newest.message is None:
            newest.message = self._decode(newest.payload, TOPICS[topic].type_name)
        return newest.message

    def _current(self, topic: str) -> Message | None:
        return self._decoded(topic) if self.fresh(topic) else None
