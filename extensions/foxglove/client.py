"""One client: its subscriptions, and the queue of what is to be sent to it.

The queue of messages is bounded: beyond the limit the oldest are dropped and the client is
notified. So a slow client delays no other, and one that reads nothing is disconnected by the
websocket's keepalive.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Collection, Iterable

from starlette.websockets import WebSocket

from extensions.foxglove import cones, protocol
from extensions.foxglove.catalogue import CHANNELS
from extensions.foxglove.protocol import ERROR, WARNING
from quadrotor.parameter_description import ParameterValue
from web.access.roles import Session

MOST_BYTES = 1_000_000  # of queued messages
MOST_TEXTS = 300  # number of queued answers
AT_ONCE = 64 * 1024  # bytes of one write
NOTICE_PERIOD = 5.0  # shortest time, in s, between two lines about dropped messages
OVERFLOW = 1008  # close code


class FoxgloveClient:
    """One client of one event loop.

    Args:
        vehicle: name of the vehicle whose topics it gets.

    Attributes:
        topics: the topics of the station that its subscriptions need.
        followed: names of the parameters whose changes it gets; None for all.
    """

    def __init__(self, socket: WebSocket, session: Session, vehicle: str) -> None:
        self.session = session
        self.topics: Collection[str] = frozenset()
        self.followed: set[str] | None = set()
        self._socket, self._vehicle = socket, vehicle
        self._subscriptions: dict[int, str] = {}
        self._numbers: dict[str, int] = {}  # topic → its subscription
        self._texts: deque[str | bytes] = deque()
        self._frames: deque[bytes] = deque()
        self._bytes = 0
        self._dropped, self._notified = 0, -NOTICE_PERIOD
        self._news = asyncio.Event()

    def subscribe(self, subscription: int, channel: int) -> None:
        """Subscribe to a channel. Raises ValueError."""
        if not 0 <= channel < len(CHANNELS):
            raise ValueError(f"there is no channel {channel}; allowed 0 to {len(CHANNELS) - 1}")
        if not 0 <= subscription < 2**32 or subscription in self._subscriptions:
            raise ValueError(f"subscription {subscription} is taken or not a 32-bit number")
        topic = CHANNELS[channel]
        if topic in self._numbers:
            raise ValueError(f"channel {channel} ({topic}) is subscribed already")
        self._subscriptions[subscription] = topic
        self._changed()

    def unsubscribe(self, subscription: int) -> None:
        """End a subscription. Raises ValueError."""
        if self._subscriptions.pop(subscription, None) is None:
            raise ValueError(f"there is no subscription {subscription}")
        self._changed()

    def _changed(self) -> None:
        self._numbers = {topic: number for number, topic in self._subscriptions.items()}
        drawn = cones.COLORS if cones.TOPIC in self._numbers else ()
        self.topics = frozenset((*self._numbers, *drawn)) - {cones.TOPIC}

    def put(self, topic: str, received_ns: int, payload: bytes) -> None:
        """Queue a message if its topic is subscribed, and its cones if they are; `wake` sends."""
        if topic in cones.COLORS and cones.TOPIC in self._numbers:
            drawn = cones.cones(topic, payload, self._vehicle)
            if drawn is not None:
                self._queue(cones.TOPIC, received_ns, drawn)
        if topic in self._numbers:
            self._queue(topic, received_ns, payload)

    def _queue(self, topic: str, received_ns: int, payload: bytes) -> None:
        number = self._numbers[topic]
        frame = protocol.message_frame(number, received_ns, payload)
        self._frames.append(frame)
        self._bytes += len(frame)
        while self._bytes > MOST_BYTES:
            self._bytes -= len(self._frames.popleft())
            self._dropped += 1

    def wake(self) -> None:
        """Send the queued messages."""
        if self._frames:
            self._news.set()

    def tell(self, answer: str | bytes) -> None:
        """Queue an answer, which is never dropped."""
        self._texts.append(answer)
        self._news.set()

    def say(self, level: int, line: str) -> None:
        """Queue a line that the client shows among its problems."""
        self.tell(protocol.text("status", level=level, message=line))

    def changed(self, values: dict[str, ParameterValue]) -> None:
        """Queue new values of the parameters that the client follows."""
        followed = self.followed
        if news := {k: v for k, v in values.items() if followed is None or k in followed}:
            self.tell(protocol.parameter_values(news))

    def follow(self, names: Iterable[str]) -> None:
        """Follow these parameters too; without names, follow all."""
        names = set(names)
        self.followed = None if not names or self.followed is None else self.followed | names

    def leave(self, names: Iterable[str], known: Iterable[str]) -> None:
        """Stop following these of the `known` parameters; without names, follow none."""
        names = set(names)
        before = set(known) if self.followed is None else self.followed
        self.followed = before - names if names else set()

    async def talk(self) -> None:
        """Send until the socket is closed."""
        while True:
            await self._news.wait()
            self._news.clear()
            while self._texts or self._frames:
                if len(self._texts) > MOST_TEXTS:
                    line = f"{len(self._texts)} answers wait for a client that does not read them"
                    await self._socket.close(OVERFLOW, line)
                    return
                if self._texts:
                    answer = self._texts.popleft()
                    is_text = isinstance(answer, str)
                    await self._socket.send(
                        {"type": "websocket.send", "text" if is_text else "bytes": answer}
                    )
                else:
                    await self._socket.send({"type": "websocket.send", "frames": self._batch()})
            self._report_dropped()

    def _batch(self) -> list[bytes]:
        batch, size = [], 0
        while self._frames and size < AT_ONCE:
            batch.append(self._frames.popleft())
            size += len(batch[-1])
        self._bytes -= size
        return batch

    def _report_dropped(self) -> None:
        now = time.monotonic()
        if self._dropped and now - self._notified >= NOTICE_PERIOD:
            count, self._dropped, self._notified = self._dropped, 0, now
            self.say(WARNING, f"{count} messages dropped: this connection is too slow for them")

    def refuse(self, error: Exception) -> None:
        """Send the client the reason why a request had no effect."""
        self.say(ERROR, str(error))
