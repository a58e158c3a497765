"""The heartbeat of a base station, and what its parts do at each beat."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial

from console.commands.stick_control import StickHandler
from console.context import StationContext
from console.exchange.status_sender import StatusSender
from console.tracker_feed import TrackerFeed

STATUS_EVERY = 4  # beats

Tick = Callable[[int], None]
"""A function that a part calls at each beat, with the number of the beat."""


class Heartbeat:
    """Sends the heartbeat at 20 Hz or, with many vehicles, 10 Hz, and raises the alarms of parts.

    Args:
        period: s between two beats.
        ticks: called at each beat.
    """

    def __init__(
        self,
        context: StationContext,
        period: float,
        sticks: StickHandler,
        tracker: TrackerFeed,
        status: StatusSender,
        ticks: Sequence[Tick],
    ) -> None:
        self._link, self._outbox, self._alarms = context.link, context.outbox, context.alarms
        self._sticks, self._tracker, self._status = sticks, tracker, status
        self._period, self._ticks = period, ticks

    def run(self, closing: threading.Event, guard: Callable[[Callable[[], None]], None]) -> None:
        """Beat until the station closes. A late beat is never caught up in a burst."""
        due, count = time.monotonic(), 0
        while not closing.is_set():
            count += 1
            guard(partial(self._beat, count))
            due = max(due + self._period, time.monotonic())
            closing.wait(due - time.monotonic())

    def _beat(self, count: int) -> None:
        """Send the heartbeat, and the status topics every fourth time or at once when the link's
        state changes.
        """
        permission = self._link.permission
        if permission.sends_heartbeats:
            self._outbox.heartbeat(count)
        self._alarms.set("permission", self._link.problem() or None)
        self._alarms.set("radio", permission.unreachable_reason or None)
        self._alarms.set("sticks", self._sticks.alarm)
        camera_alarms = ("tracker", self._tracker.alarm), ("camera", self._tracker.camera_alarm)
        for key, line in camera_alarms:
            if line != self._alarms.keyed().get(key):
                self._alarms.set(key, None)  # so that a different problem is reported as well
            self._alarms.set(key, line)
        for tick in self._ticks:
            tick(count)
        if count % STATUS_EVERY == 0 or self._status.link_changed:
            self._status.send()
