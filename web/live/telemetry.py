"""`/ws/telemetry`: the signals that a page requests, as small binary frames at 25 Hz.

The page sends `{"id": 3, "signals": ["state.position.x", …]}` whenever its selection changes.
A frame (little endian): uint16 id, uint16 count, float64 time (s, this computer's epoch), uint16
age in ms (65535: never or longer) of each topic of these signals, in the order of
`web.latest.STALE`, float32 values. With the 40 signals of state table, default charts and
Beacons tab, a frame has 186 B and a page costs 4.7 kB/s with the heads of the websocket; the
maximum of 96 signals costs 10.6 kB/s. Only what a page requests is computed.

`{"ping": 12.5}` is answered at once by `{"pong": 12.5}`, which measures the page's own link.
"""

from __future__ import annotations

import asyncio
import math
import struct
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import msgspec
import numpy as np
from fastapi import WebSocket

from quadrotor.errors import OutOfBoundsError
from vehicle_link.clock import wall_time
from web.latest import STALE, Live
from web.live.conversation import converse
from web.signals import INDEX, SIGNALS, UNITS, snapshot, topics_for
from web.signals.expression import Expression, is_expression, parse
from web.signals.functions import Step

RATE = 25.0  # Hz
MOST_SIGNALS = 96  # state table, four charts and the Beacons tab together
NEVER = 65535


class Subscription(msgspec.Struct, forbid_unknown_fields=True):
    """Selection of a page; a derived signal's name is its expression (web.signals.expression)."""

    id: int
    signals: list[str]


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
        raise ValueError(f"a subscription is {{id, signals}}: {error}") from error
    try:
        for name in filter(is_expression, wanted.signals):
            expression_of(name)
    except OutOfBoundsError as error:
        raise ValueError(str(error)) from error
    unknown = [name for name in wanted.signals if name not in INDEX and not is_expression(name)]
    if unknown:
        raise ValueError(f"unknown signal {unknown[0]!r}; /api/signals lists them")
    if len(wanted.signals) > MOST_SIGNALS:
        raise ValueError(f"{len(wanted.signals)} signals; at most {MOST_SIGNALS} at once")
    if not 0 <= wanted.id <= 0xFFFF:
        raise ValueError(f"id {wanted.id}; allowed 0 to 65535")
    return wanted


@lru_cache(256)
def expression_of(text: str) -> Expression:
    """Return the live derived signal of a text. Raises OutOfBoundsError."""
    return parse(text, UNITS)


def topics_of(signals: Sequence[str]) -> list[str]:
    """Return the topics whose ages a frame of these signals has, in its order."""
    found = {topic_of(name) for name in signals}
    return [topic for topic in STALE if topic in found]


def topic_of(name: str) -> str:
    """Return a signal's topic; that of a derived one is its first input's."""
    first = expression_of(name).inputs[0] if is_expression(name) else name
    return SIGNALS[INDEX[first]].topic


def described_expression(text: str) -> dict[str, Any]:
    """Return the live derived signal of a text for the page. Raises OutOfBoundsError."""
    expression = expression_of(text)
    return expression.described(topic_of(expression.name))


def frame(identity: int, stamp: float, ages: Sequence[float], values: Sequence[float]) -> bytes:
    """Return one frame; `stamp` and `ages` in s."""
    milliseconds = [min(NEVER, round(1e3 * age)) if math.isfinite(age) else NEVER for age in ages]
    return struct.pack(
        f"<HHd{len(ages)}H{len(values)}f", identity, len(values), stamp, *milliseconds, *values
    )


class _Page:
    """Subscription of one page."""

    def __init__(self, wanted: Subscription) -> None:
        self.identity = wanted.id
        self.signals = wanted.signals
        self.topics = topics_of(wanted.signals)


class TelemetryFeed:
    """Feed that computes the snapshot once a period, however many pages are open."""

    def __init__(self, live: Live, clock: Callable[[], float] = wall_time) -> None:
        self._live = live
        self._clock = clock
        self._tick = asyncio.Condition()
        self._values: list[float] = []
        self._derived: dict[str, tuple[Expression, Step]] = {}  # those that pages request
        self._derived_values: dict[str, float] = {}
        self._ages: dict[str, float] = {}
        self._stamp = 0.0
        self._pages: dict[WebSocket, _Page] = {}

    @property
    def pages(self) -> int:
        return len(self._pages)

    @property
    def topics(self) -> frozenset[str]:
        """Return the topics from which the open pages' signals are computed."""
        return topics_for(self._wanted)

    @property
    def _wanted(self) -> frozenset[str]:
        names = {name for page in self._pages.values() for name in page.signals}
        derived = {name for name in names if is_expression(name)}
        inputs = {one for name in derived for one in expression_of(name).inputs}
        return frozenset(names - derived | inputs)

    async def run(self) -> None:
        loop = asyncio.get_running_loop()
        deadline = loop.time()
        while True:
            deadline = max(deadline + 1.0 / RATE, loop.time())
            await asyncio.sleep(deadline - loop.time())
            if not self._pages:
                continue
            self._values = snapshot(self._live, self._wanted)
            self._ages = {topic: self._live.age(topic) for topic in STALE}
            self._stamp = self._clock()
            self._derive()
            async with self._tick:
                self._tick.notify_all()

    def _derive(self) -> None:
        """Compute the derived signals, each once for all pages."""
        names = {name for page in self._pages.values() for name in page.signals}
        kept = {name: one for name, one in self._derived.items() if name in names}
        for name in filter(is_expression, names - set(kept)):
            expression = expression_of(name)
            kept[name] = expression, expression.start()
        self._derived = kept
        time = np.array([self._stamp])
        self._derived_values = {
            name: float(
                step(time, {one: np.array([self._values[INDEX[one]]]) for one in of.inputs})[0]
            )
            for name, (of, step) in kept.items()
        }

    def _value(self, name: str) -> float:
        place = INDEX.get(name)
        return self._derived_values.get(name, math.nan) if place is None else self._values[place]

    async def serve(self, socket: WebSocket) -> None:
        await socket.accept()
        self._pages[socket] = _Page(Subscription(0, []))

        async def listen() -> None:
            while (event := await socket.receive())["type"] != "websocket.disconnect":
                asked = parse_request(event.get("text") or "")
                if isinstance(asked, Ping):
                    await socket.send_text(f'{{"pong":{asked.ping!r}}}')
                else:
                    self._pages[socket] = _Page(asked)

        async def talk() -> None:
            while True:
                page = self._pages[socket]  # a request received now counts for the next snapshot
                async with self._tick:
                    await self._tick.wait()
                ages = [self._ages[topic] for topic in page.topics]
                values = [self._value(name) for name in page.signals]
                await socket.send_bytes(frame(page.identity, self._stamp, ages, values))

        try:
            await converse(socket, talk(), listen())
        except ValueError as error:
            await socket.close(1008, str(error)[:120])
        finally:
            del self._pages[socket]
