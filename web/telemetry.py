"""`/ws/telemetry`: the signals a page asked for, as small binary frames at 25 Hz.

The page sends `{"id": 3, "signals": ["state.position.x", …]}` whenever its selection changes.
A frame (little endian): uint16 id, uint16 count, float64 time (s, this computer's epoch),
uint16 age in ms of each topic of `web.live.STALE` (65535: never or longer), float32 values.
With 40 signals (state table, charts as they come, Beacons tab) a frame has 198 B and a page costs
5.1 kB/s with the heads of the websocket; the most there may be, 64, cost 7.5 kB/s.
"""

from __future__ import annotations

import asyncio
import math
import struct
import time
from collections.abc import Callable, Sequence

import msgspec
from fastapi import WebSocket
from starlette.websockets import WebSocketDisconnect

from web.live import STALE, Live
from web.signals import INDEX, snapshot

RATE = 25.0  # Hz
MOST_SIGNALS = 64  # of state table, both charts and the Beacons tab together
NEVER = 65535


class Subscription(msgspec.Struct, forbid_unknown_fields=True):
    id: int
    signals: list[str]


def parse(text: str) -> Subscription:
    """Unknown names are refused, so that a page of another version notices. Raises ValueError."""
    try:
        wanted = msgspec.json.decode(text, type=Subscription)
    except msgspec.DecodeError as error:
        raise ValueError(f"a subscription is {{id, signals}}: {error}") from error
    unknown = [name for name in wanted.signals if name not in INDEX]
    if unknown:
        raise ValueError(f"unknown signal {unknown[0]!r}; /api/signals lists them")
    if len(wanted.signals) > MOST_SIGNALS:
        raise ValueError(f"{len(wanted.signals)} signals; at most {MOST_SIGNALS} at once")
    if not 0 <= wanted.id <= 0xFFFF:
        raise ValueError(f"id {wanted.id}; allowed 0 to 65535")
    return wanted


def frame(identity: int, stamp: float, ages: Sequence[float], values: Sequence[float]) -> bytes:
    """One frame; `stamp` and `ages` in s."""
    milliseconds = [min(NEVER, round(1e3 * age)) if math.isfinite(age) else NEVER for age in ages]
    return struct.pack(
        f"<HHd{len(ages)}H{len(values)}f", identity, len(values), stamp, *milliseconds, *values
    )


class TelemetryFeed:
    """Computes the snapshot once a period however many pages are open."""

    def __init__(self, live: Live, clock: Callable[[], float] = time.time) -> None:
        self._live = live
        self._clock = clock
        self._tick = asyncio.Condition()
        self._values: list[float] = []
        self._ages: list[float] = []
        self._stamp = 0.0
        self._pages = 0

    async def run(self) -> None:
        loop = asyncio.get_running_loop()
        deadline = loop.time()
        while True:
            deadline = max(deadline + 1.0 / RATE, loop.time())
            await asyncio.sleep(deadline - loop.time())
            if self._pages == 0:
                continue
            self._values = snapshot(self._live)
            self._ages = [self._live.age(topic) for topic in STALE]
            self._stamp = self._clock()
            async with self._tick:
                self._tick.notify_all()

    async def serve(self, socket: WebSocket) -> None:
        await socket.accept()
        wanted = Subscription(0, [])
        self._pages += 1

        async def listen() -> None:
            nonlocal wanted
            while (event := await socket.receive())["type"] != "websocket.disconnect":
                wanted = parse(event.get("text") or "")

        async def talk() -> None:
            while True:
                async with self._tick:
                    await self._tick.wait()
                chosen = [self._values[INDEX[name]] for name in wanted.signals]
                await socket.send_bytes(frame(wanted.id, self._stamp, self._ages, chosen))

        listening, talking = asyncio.create_task(listen()), asyncio.create_task(talk())
        try:
            await asyncio.wait({listening, talking}, return_when=asyncio.FIRST_COMPLETED)
            if listening.done() and (error := listening.exception()):
                if not isinstance(error, ValueError):
                    raise error
                await socket.close(1008, str(error)[:120])
            elif talking.done() and not isinstance(
                error := talking.exception(), WebSocketDisconnect | OSError
            ):
                assert error is not None
                raise error
        finally:
            self._pages -= 1
            for task in (listening, talking):
                task.cancel()
            await asyncio.gather(listening, talking, return_exceptions=True)
