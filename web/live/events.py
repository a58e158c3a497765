"""`/ws/events`: events as JSON: a summary at 5 Hz, log lines, parameter changes.

Every page gets the same. A page that does not keep up is disconnected and starts again when it
reconnects, which is simpler than a backlog and shows no old news.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections import deque
from collections.abc import Callable, Collection, Iterable
from typing import Any

from fastapi import WebSocket

from console.parameters.history import ParameterHistory
from console.runs.event_book import EventBook
from console.trackers.camera_figures import figures_text
from vehicle_link.clock import real_time_factor, wall_time
from vehicle_link.commands import EventKind
from vehicle_link.messages import records
from web.access.roles import Session
from web.latest import CHARTED, STALE, Live
from web.live.conversation import converse, send_json, significant

Message = dict[str, Any]

RATE = 5.0  # Hz, of the summary
OF_ALL = ("runs",)
"""Types of messages that are published to the pages of every vehicle."""
KEPT = 500  # events and parameter changes that a new page gets
WAITING = 500  # unsent messages of a page, beyond which it is disconnected
SUMMARY_NOW: Message = {"type": "summary now"}
"""Message of the hub on which every page gets its summary without waiting for the next."""
NOISES = ("accelerometer", "gyroscope", "measurement")
LEVELS = {10: "debug", 20: "info", 30: "warn", 40: "error", 50: "error"}


def kept_lines(book: EventBook, history: ParameterHistory) -> list[Message]:
    """Return the events and parameter changes that the station has kept, oldest first of each.

    Raises StorageError.
    """
    lines = [
        event(
            LEVELS.get(one.level, "info"),
            one.text,
            one.source,
            1e-9 * one.stamp_ns,
            1e-9 * one.sent_ns or None,
            is_act=EventKind.ACT in one.kinds.split(),
        )
        for one in book.newest()
    ]
    changes = [
        parameter_change(one.name, one.old, one.new, one.requester, 1e-9 * one.stamp_ns)
        for one in reversed(history.changes(limit=KEPT))
    ]
    return lines + changes


class EventHub:
    """Distributor of messages to all open pages of a vehicle.

    It is to be used from the event loop's thread, except where a method says otherwise.

    Args:
        hubs: those of all vehicles, to which this one is added.
    """

    def __init__(self, hubs: list[EventHub] | None = None) -> None:
        self._hubs = [] if hubs is None else hubs
        self._hubs.append(self)
        self._pages: set[asyncio.Queue[Message | None]] = set()
        self._lines: deque[Message] = deque(maxlen=KEPT)
        self._loop: asyncio.AbstractEventLoop | None = None

    def attach(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop

    @property
    def pages(self) -> int:
        return len(self._pages)

    @property
    def lines(self) -> list[Message]:
        return list(self._lines)

    def begin(self, lines: Iterable[Message]) -> None:
        """Begin with the events from before this process."""
        self._lines.extend(sorted(lines, key=lambda line: float(line["stamp"])))

    def publish(self, message: Message) -> None:
        for hub in self._hubs if message["type"] in OF_ALL else (self,):
            hub._hand_out(message)

    def _hand_out(self, message: Message) -> None:
        if message["type"] in ("event", "parameter"):
            self._lines.append(message)
        for queue in self._pages:
            if queue.qsize() >= WAITING:
                _empty(queue)
                queue.put_nowait(None)  # disconnects the page
            else:
                queue.put_nowait(message)

    def publish_from_thread(self, message: Message) -> None:
        self.call(self.publish, message)

    def call(self, act: Callable[..., None], *arguments: object) -> None:
        """Call a function on the event loop, from any thread, while the loop runs."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(act, *arguments)

    def runs_changed(self, run_ids: Iterable[str]) -> None:
        """Notify the pages, from any thread; they request again what they show."""
        self.publish_from_thread({"type": "runs", "runs": list(run_ids)})

    def say(self, level: str, text: str) -> None:
        """Publish a line of this process in everyone's event list."""
        self.publish(event(level, text, "web", wall_time()))

    @contextlib.contextmanager
    def subscribe(self) -> Any:
        queue: asyncio.Queue[Message | None] = asyncio.Queue()
        self._pages.add(queue)
        try:
            yield queue
        finally:
            self._pages.discard(queue)


def parameter_change(name: str, old: object, new: object, requester: str, stamp: float) -> Message:
    """Return the message of a changed parameter; `stamp` in s, epoch."""
    what = {"type": "parameter", "name": name, "old": old, "value": new, "requester": requester}
    return {**what, "stamp": stamp, "text": f"{name}: {old} → {new}"}


def event(
    level: str,
    text: str,
    source: str,
    stamp: float,
    time: float | None = None,
    *,
    is_act: bool = False,
) -> Message:
    """Return an event; `stamp` in s, epoch; `level` is info, warn or error.

    Args:
        time: s, by the vehicle's clock, which the charts show.
        is_act: whether a person did or asked for it.
    """
    what = {"type": "event", "level": level, "text": text, "source": source, "act": is_act}
    return {**what, "stamp": stamp, "time": time}


async def serve(
    socket: WebSocket,
    hub: EventHub,
    session: Session,
    hello: Callable[[], Message],
    summary: Callable[[], Message],
) -> None:
    """Serve one page's socket until it closes; send only the changed parts of the summary."""
    await socket.accept()

    async def talk(queue: asyncio.Queue[Message | None]) -> None:
        await send_json(socket, {"type": "hello", "session": session_fields(session), **hello()})
        sent: Message = {}
        due = 0.0
        while True:
            wait = due - time.monotonic()
            if wait <= 0.0:
                fresh = summary()
                changed = {k: v for k, v in fresh.items() if k not in sent or sent[k] != v}
                sent = fresh
                await send_json(socket, {"type": "summary", **changed})
                due = time.monotonic() + 1.0 / RATE
                continue
            with contextlib.suppress(TimeoutError):
                message = await asyncio.wait_for(queue.get(), wait)
                if message is None:
                    return await socket.close(1013, "too slow for the events; it reads them again")
                if message is SUMMARY_NOW:
                    due = 0.0
                else:
                    await send_json(socket, message)

    with hub.subscribe() as queue:
        await converse(socket, talk(queue))


def summarize(live: Live) -> Message:
    """Return the bar's content: the newest status messages and the age (s) of each topic."""
    ages = {topic: live.age(topic) for topic in STALE if topic not in CHARTED}
    return {
        "age": {t: round(a, 2) if math.isfinite(a) else None for t, a in ages.items()},
        "status": _fields(live.newest("status")),
        "station": _station(live.newest("station_status")),
        "link": _fields(live.newest("link_status")),
        "tracker": _tracker(live.newest("tracker_status"), "tags"),
        "camera": _tracker(live.newest("camera_status"), "beacons"),
        "battery": _battery(live.newest("battery")),
        "estimate": _estimate(live.newest("estimator")),
    }


def session_fields(session: Session) -> Message:
    return {"label": session.label, "role": session.role.value, "account": session.has_account}


def _station(message: records.StationStatus | None) -> Message | None:
    """Return the fields of the station's status.

    In a simulation the real-time factor is that of this process, because the simulated time may be
    waiting for the station.
    """
    fields, factor = _fields(message), real_time_factor()
    return {**fields, "real_time_factor": factor} if fields and factor else fields


def _tracker(message: records.TrackerStatus | None, markers: str) -> Message | None:
    """Return the fields of a tracker's status, and a text on how well each camera sees."""
    if message is None or (fields := _fields(message, ("cameras",))) is None:
        return None
    return {**fields, "sees": [figures_text(one, markers) for one in message.cameras]}


def _battery(message: records.BatteryState | None) -> Message | None:
    if message is None:
        return None
    return {"voltage": round(float(message.voltage), 2), "percentage": _number(message.percentage)}


def _estimate(message: records.EstimatorStatus | None) -> Message | None:
    """Return how well the estimate in use and its measurements agree.

    The values are rounded, so that they change only when it matters.
    """
    if message is None:
        return None
    names = ("consistency", "refused_share", *(f"{kind}_noise_scale" for kind in NOISES))
    return {name: significant(float(getattr(message, name)), 2) for name in names}


def _fields(message: records.Message | None, others: Collection[str] = ()) -> Message | None:
    """Return the flat fields of a message, without its header and these others."""
    if message is None:
        return None
    without = ("header", "__msgtype__", *others)
    names = [name for name in message.__dataclass_fields__ if name not in without]
    return {name: _number(getattr(message, name)) for name in names}


def _number(value: object) -> object:
    """Return a value for JSON, which has no NaN and no numpy arrays, with six digits."""
    if isinstance(value, float):
        return significant(value)
    return value.tolist() if hasattr(value, "tolist") else value


def _empty(queue: asyncio.Queue[Message | None]) -> None:
    while not queue.empty():
        queue.get_nowait()
