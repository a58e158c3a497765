"""Newest message of each topic and its age.

Zenoh's threads store payloads; the page's loops read messages at their own pace, so that what no
page shows is never decoded. Ages use this computer's monotonic clock, from the arrival, and so need
no clock of the vehicle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

from vehicle_link.clock import monotonic
from vehicle_link.messages.records import Message
from vehicle_link.topics.table import TOPICS

if TYPE_CHECKING:
    from vehicle_link.topics.typed_tables import Newest

STALE = {name: row.stale for name, row in TOPICS.items() if row.stale}
"""Topics whose newest message is stored.

The value is the age, in s, above which its values are shown in grey and charts show a gap.
"""

FAST = frozenset(name for name in STALE if TOPICS[name].page != "always")
"""Those among them that arrive many times a second, or are computed only while shown."""

CHARTED = tuple(name for name in STALE if TOPICS[name].page == "chart")
"""Those among them that only charts need."""


@dataclass(slots=True)
class _Newest:
    payload: bytes
    received: float  # s, monotonic
    message: Message | None = None


class Live:
    """Newest messages of one vehicle.

    Args:
        decode: called as `decode(payload, type_name)`; returns the message.
        clock: s, monotonic.
    """

    def __init__(
        self, decode: Callable[[bytes, str], Message], clock: Callable[[], float] = monotonic
    ) -> None:
        self._decode = decode
        self._clock = clock
        self._newest: dict[str, _Newest] = {}
        self.newest = cast("Newest", self._decoded)
        """Return the newest message whatever its age, decoded once; None before the first."""
        self.current = cast("Newest", self._current)
        """Return the newest message, or None when it is stale."""

    def put(self, topic: str, payload: bytes) -> None:
        """Store a message; may be called from any thread."""
        self._newest[topic] = _Newest(payload, self._clock())

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
        if newest.message is None:
            newest.message = self._decode(newest.payload, TOPICS[topic].type_name)
        return newest.message

    def _current(self, topic: str) -> Message | None:
        return self._decoded(topic) if self.fresh(topic) else None
