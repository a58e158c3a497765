"""`/ws/telemetry`: what a page shows of its signals, in one binary frame each 40 ms.

The page sends, whenever its selection changes,

    {"id": 3, "signals": ["battery.voltage", …], "origin": 1700000000,
     "series": [{"signals": ["state.position.x", …], "after": 12.5}, …]}

Of `signals` a frame has the newest values; of each of the `series`, at the samples of its first
signal (others are interpolated as in `web.signals.evaluator`), every sample since the last frame:
at first all that are kept from `after` on (s since `origin`, see web.live.frames; without it from
the oldest). With `"ages": false` a frame has no ages. Only what a page requests is computed. A page
that reads slowly gets coarser series, and a frame has what is new when it is sent: nothing waits.

`{"ping": 12.5}` is answered at once by `{"pong": 12.5}`, which measures the page's own link.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Sequence
from typing import Annotated

import msgspec
import numpy as np
from fastapi import WebSocket

from quadrotor.errors import OutOfBoundsError
from vehicle_link.clock import monotonic
from web.latest import STALE, Live
from web.live import frames
from web.live.conversation import converse
from web.live.signal_log import SignalLog, expression_of
from web.live.topic_logs import KEPT
from web.signals import PLACES, topics_for
from web.signals.evaluator import Made, count_before
from web.signals.expression import is_expression

RATE = 25.0  # Hz
MOST_SIGNALS = 96  # state table, four charts and the Beacons tab together
MOST_KEPT = 4 * MOST_SIGNALS
"""Signals of pages, also of those that have gone, whose samples are kept; of these at most
MOST_SIGNALS derived ones: a page can ask for others as often as it likes."""
SLOW = 0.3
"""Seconds that a frame waits to be sent, above which a page is slow."""
SLOWEST = 128
REST = 0.01
"""Seconds before a frame of what a page has missed, which leave the event loop to others."""
AT_ONCE, AT_LEAST = 32_768, 512
"""Samples of all series in one frame, and those that each series counts at least."""
QUICK = 50
"""Number of frames that were sent at once, after which a slow page gets finer series again."""


class Series(msgspec.Struct, forbid_unknown_fields=True):
    """Signals at each sample of the first one, from `after` (s) on."""

    signals: Annotated[list[str], msgspec.Meta(min_length=1)]
    after: float | None = None


class Subscription(msgspec.Struct, forbid_unknown_fields=True):
    """Selection of a page; a derived signal's name is its expression (web.signals.expression)."""

    id: Annotated[int, msgspec.Meta(ge=0, le=65535)]
    signals: list[str]
    series: list[Series] = []
    origin: float = 0.0
    ages: bool = True

    @property
    def names(self) -> list[str]:
        return [*self.signals, *(name for one in self.series for name in one.signals)]


class Ping(msgspec.Struct, forbid_unknown_fields=True):
    ping: float


def parse_request(text: str) -> Subscription | Ping:
    """Parse a request of the page. Raises ValueError.

    Unknown names are refused, so that a page of another version notices.
    """
    try:
        if text.startswith('{"ping"'):
            return msgspec.json.decode(text, type=Ping)
        wanted = msgspec.json.decode(text, type=Subscription)
    except msgspec.DecodeError as error:
        raise ValueError(f"a subscription is {{id, signals, series}}: {error}") from error
    if len(names := wanted.names) > MOST_SIGNALS:
        raise ValueError(f"{len(names)} signals; at most {MOST_SIGNALS} at once")
    try:
        for name in filter(is_expression, names):
            expression_of(name)
    except OutOfBoundsError as error:
        raise ValueError(str(error)) from error
    if unknown := [name for name in names if name not in PLACES and not is_expression(name)]:
        raise ValueError(f"unknown signal {unknown[0]!r:.80}; /api/signals lists them")
    return wanted


def topics_of(signals: Sequence[str]) -> list[str]:
    """Return the topics whose ages a frame of these signals has, in its order."""
    found = {topic_of(name) for name in signals}
    return [topic for topic in STALE if topic in found]


def topic_of(name: str) -> str:
    """Return a signal's topic; that of a derived one is its first input's."""
    return PLACES[expression_of(name).inputs[0] if is_expression(name) else name].topic


def described_expression(text: str) -> dict[str, object]:
    """Return the live derived signal of a text for the page. Raises OutOfBoundsError."""
    expression = expression_of(text)
    return expression.described(topic_of(expression.name))


class _Page:
    """Subscription of one page, and what it has of it.

    Attributes:
        after: of each series, the time of the last sample that was sent.
        slowness: number of samples that become one.
        is_behind: whether there is more to send than the last frame had.
        left: number of samples that the frame may still have.
    """

    def __init__(self, wanted: Subscription, slowness: int = 1) -> None:
        self.wanted, self.slowness, self.quick = wanted, slowness, 0
        self.origin, self.is_behind, self.left = wanted.origin, False, AT_ONCE
        self.topics = topics_of(wanted.names) if wanted.ages else []
        self.after = [-math.inf if one.after is None else one.after for one in wanted.series]

    def sent(self, seconds: float) -> None:
        """Note how long a frame took to be sent."""
        if seconds > SLOW:
            self.slowness, self.quick = min(max(4, 2 * self.slowness), SLOWEST), 0
        else:
            self.quick += 1
        if self.quick >= QUICK and self.slowness > 1:
            self.slowness, self.quick = self.slowness // 2 if self.slowness > 4 else 1, 0


class TelemetryFeed:
    """Feed that sorts in what has arrived once a period, however many pages are open."""

    def __init__(self, live: Live, log: SignalLog, clock: Callable[[], float] = monotonic) -> None:
        self._live, self._log, self._clock = live, log, clock
        self._tick, self._turn = asyncio.Condition(), asyncio.Lock()
        self._pages: dict[WebSocket, _Page] = {}
        self._asked: dict[str, float] = {}  # s, when a page wanted each signal last
        self._made = Made()
        self._parts: dict[tuple[object, ...], bytes] = {}

    @property
    def pages(self) -> int:
        return len(self._pages)

    @property
    def topics(self) -> frozenset[str]:
        """Return the topics from which the signals of pages are computed, including pages that have
        been away for less than KEPT: they get the samples that they missed.
        """
        derived = set(filter(is_expression, self._asked))
        inputs = {one for name in derived for one in expression_of(name).inputs}
        return topics_for(self._asked.keys() - derived | inputs)

    async def run(self) -> None:
        loop = asyncio.get_running_loop()
        deadline = loop.time()
        while True:
            deadline = max(deadline + 1.0 / RATE, loop.time())
            await asyncio.sleep(deadline - loop.time())
            self.step()
            async with self._tick:
                self._tick.notify_all()

    def step(self) -> None:
        """Sort in newly arrived messages, and compute the next samples of derived signals."""
        now = self._clock()
        for name in (name for page in self._pages.values() for name in page.wanted.names):
            self._asked.pop(name, None)  # the newest last
            self._asked[name] = now
        newest = [*self._asked.items()][-MOST_KEPT:]
        self._asked = {name: at for name, at in newest if now - at <= KEPT}
        self._made.clear()
        self._parts.clear()
        self._log.take()
        self._log.keep([*filter(is_expression, self._asked)][-MOST_SIGNALS:])
        self._log.advance()

    def frame(self, page: _Page) -> bytes:
        """Return what a page has to get now."""
        origin = 1e-9 * self._log.origin_ns
        if page.origin != origin:
            page.origin, page.after = origin, [-math.inf] * len(page.after)
        page.is_behind, page.left = False, AT_ONCE
        parts = [part for at in range(len(page.after)) if (part := self._part(page, at))]
        ages = [self._live.age(topic) for topic in page.topics]
        values = [self._newest(name) for name in page.wanted.signals]
        clock = origin, self._log.now
        return frames.frame(page.wanted.id, page.slowness, clock, ages, values, parts)

    def _newest(self, name: str) -> float:
        """Return the newest value of a signal; NaN while its topic is old."""
        count = self._log.formed(name) if self._live.fresh(topic_of(name)) else 0
        return float(self._log.values(name, count - 1, count, self._made)[0]) if count else math.nan

    def _part(self, page: _Page, place: int) -> bytes:
        """Return the new samples of one series; empty without any."""
        if page.left <= 0:
            page.is_behind = True
            return b""
        names = page.wanted.series[place].signals
        topic = self._log.log(topic_of(names[0]))
        if topic is None:
            return b""
        first = count_before(topic.time, page.after[place])
        count = min(self._log.formed_at(name, topic.time) for name in names)
        if count <= first:
            return b""
        first, last, of = frames.piece(first, count, page.slowness)
        page.left -= max(AT_LEAST, last - first)
        page.after[place] = float(topic.time[last - 1])
        page.is_behind = page.is_behind or last < count
        key = (place, *names, first, last, of)
        if key not in self._parts:
            before = topic.time[first - 1 : first] if first else [math.nan]
            columns = [self._log.at(name, topic.time, first, last, self._made) for name in names]
            holes = {k - first: n for k, n in topic.missing(first, last).items()}
            times = np.concatenate([before, topic.time[first:last]])
            self._parts[key] = frames.series(place, of, *frames.joined(times, columns, of, holes))
        return self._parts[key]

    async def serve(self, socket: WebSocket) -> None:
        await socket.accept()
        self._pages[socket] = _Page(Subscription(0, []))

        async def listen() -> None:
            while (event := await socket.receive())["type"] != "websocket.disconnect":
                asked = parse_request(event.get("text") or "")
                if isinstance(asked, Ping):
                    await socket.send_text(f'{{"pong":{asked.ping!r}}}')
                else:
                    self._pages[socket] = _Page(asked, self._pages[socket].slowness)

        async def talk() -> None:
            loop = asyncio.get_running_loop()
            page = self._pages[socket]
            while True:
                if not page.is_behind:
                    async with self._tick:
                        await self._tick.wait()
                async with self._turn:  # one page after the other, others' requests between them
                    await asyncio.sleep(REST if page.is_behind else 0.0)
                page = self._pages[socket]
                frame, began = self.frame(page), loop.time()
                await socket.send_bytes(frame)
                page.sent(loop.time() - began)

        try:
            await converse(socket, talk(), listen())
        except ValueError as error:
            await socket.close(1008, str(error)[:120])
        finally:
            del self._pages[socket]
