"""The state of station and link, published: `station_status` and `link_status`."""

from __future__ import annotations

from collections.abc import Callable

from console.context import StationContext
from console.link.outbox import INFO, WARN
from console.tracker_feed import TrackerFeed
from vehicle_link.clock import real_time_factor, time_ns
from vehicle_link.messages import header, new
from vehicle_link.messages.records import LinkStatus
from vehicle_link.set_clock import SetClock
from vehicle_link.transport.heartbeat import LinkState


class StatusSender:
    """Sends both statuses; used by one thread. `on_link` is called with each LinkStatus."""

    def __init__(
        self, context: StationContext, tracker: TrackerFeed, on_link: Callable[[LinkStatus], None]
    ) -> None:
        self._outbox, self._link = context.outbox, context.link
        self._recorder, self._alarms = context.recorder, context.alarms
        self._tracker, self._on_link = tracker, on_link
        self._published_state = LinkState.LOST
        self._set_clock = SetClock("base station")

    @property
    def link_changed(self) -> bool:
        """Return whether the link's state differs from the one published last."""
        return self._link.state() is not self._published_state

    def send(self) -> None:
        """Send both statuses, and an event when the link's state has changed since the
        last time.
        """
        now_ns, stamp_ns = time_ns(), self._link.vehicle_ns()
        state = self._link.state()
        if state is not self._published_state:
            self._published_state = state
            self._outbox.say(INFO if state is LinkState.GOOD else WARN, f"link {state}")
        if line := self._set_clock.report():
            self._outbox.say(WARN, line)
        recorder = self._recorder.status()
        status = new(
            "quadlab_msgs/StationStatus",
            header=header(stamp_ns),
            recording=recorder.recording,
            run_id=recorder.run_id,
            recording_duration=recorder.duration,
            recording_bytes=recorder.bytes,
            free_bytes=recorder.free_bytes,
            tracker_rate=self._tracker.rate,
            real_time_factor=real_time_factor(),
            alarms=self._alarms.lines(recorder.alarms),
        )
        self._outbox.message("station_status", status, stamp_ns)
        link_status = self._link.message(now_ns)
        self._on_link(link_status)
        self._outbox.message("link_status", link_status, stamp_ns)
