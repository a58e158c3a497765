"""`quadlab tracker`: the process that sends a tracking system's bodies to the station.

One thread reads the source and retries while none answers; the other maps stamps, monitors the
bodies, and publishes each vehicle's poses (`tracker_body`, stamps of the station's clock) and
status (`tracker_status`). The station converts them to the vehicle's clock and forwards them.
"""

from __future__ import annotations

import queue
import re
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from console.tracker_feed import ENDED
from console.trackers.camera_figures import CameraPicture, View, figures_text
from console.trackers.health import Unit, Up, to_world
from console.trackers.source import Body, Frame, Source
from console.trackers.source_reader import RETRY, SourceReader, is_final
from console.trackers.system_clock import SystemClock
from console.trackers.tracked_vehicle import TopicNames, TrackedVehicle, check_alone
from quadrotor.errors import MeasurementError
from quadrotor.plain_rotations import Array
from quadrotor.records import NO_ATTITUDE, pose_sample
from vehicle_link.clock import monotonic, monotonic_ns, time_ns
from vehicle_link.messages import encode, header, new
from vehicle_link.messages.records import TrackerStatus
from vehicle_link.termination_signal import Ending
from vehicle_link.topics.measurements import encode_picture, pose_messages
from vehicle_link.topics.table import TRACKER_PICTURES

if TYPE_CHECKING:
    from vehicle_link.transport.loopback import Session
STATUS_PERIOD = 0.1
"""Seconds between two statuses; a new problem is published at once."""
GAP = 0.2
"""Seconds without a body, or without frames, until it is reported."""
FIRST_FRAME = 5.0
"""Seconds from the start that a system has for its first frame: some connect slowly."""
RECENT = 1.0
"""Seconds over which rates are counted."""
KEPT = 64
LATENCIES, STEP = 32, 0.001
"""Bars of the histogram of latency, and their width in s."""
LISTED_MAX = 8
"""Maximum number of bodies listed in a line."""
OTHERS = 64
"""Maximum number of bodies that are noted besides those of the vehicles."""


_FIGURES = re.compile(r"[\d.]+")


class Tracker:
    """Publishes the poses of a tracking system's bodies, and its status.

    Args:
        name: the system and its address, for messages.
        open_source: connects; may raise QuadlabError, and is then retried.
        bodies: the system's name of each vehicle's body.
        session: with the station.
        unit, up: of the system's positions, and its axis that points up.
        views: one for each camera, filled by the source; none for another system.
    """

    topics = TopicNames("tracker_body", "tracker_status", TRACKER_PICTURES)
    markers = "tags"
    unseen_for = GAP

    def __init__(
        self,
        name: str,
        open_source: Callable[[], Source],
        bodies: Mapping[str, str],
        session: Session,
        unit: Unit = "m",
        up: Up = "z",
        views: Sequence[View] = (),
    ) -> None:
        self._name, self._open_source, self._unit, self._up = name, open_source, unit, up
        self._vehicles = [
            TrackedVehicle(session, vehicle, body, self.topics) for vehicle, body in bodies.items()
        ]
        self._session, self._views = session, views
        self._shown: list[CameraPicture | None] = [None] * len(views)
        if views:
            encode_picture(0, b"", "")  # generates its serialiser now, which takes a second
        self._clock = SystemClock()
        self._items: queue.Queue[Frame | Exception] = queue.Queue(KEPT)
        self._frames: deque[float] = deque()
        self._seen: deque[tuple[float, str]] = deque()
        self._places: dict[str, Array] = {}
        self._latencies: deque[float] = deque(maxlen=1000)
        self._source_problem = ""  # of the whole system
        self._last_frame_at = monotonic()
        self._frames_due_at = self._last_frame_at + FIRST_FRAME
        self._status_at = 0.0
        self._note, self._noted = "", 0.0  # a recent event of the system
        self._reader: SourceReader | None = None

    def run(self, stopping: Ending) -> None:
        """Run until `stopping`. Raises UsageError when the source cannot be opened as requested,
        RefusedError when another process sends a vehicle's poses.
        """
        try:
            check_alone(self._session, self._vehicles, self.topics.status, stopping)
            self._frames_due_at = monotonic() + FIRST_FRAME
            self._reader = SourceReader("source", self._open_source, self._items.put)
            while not stopping.wait(0.0):
                try:
                    item = self._items.get(timeout=STATUS_PERIOD / 2)
                except queue.Empty:
                    pass
                else:
                    if isinstance(item, Frame):
                        self._handle(item)
                    elif is_final(item):
                        raise item
                    elif isinstance(item, MeasurementError):
                        self._note, self._noted = f"{self._name}: {item}", monotonic()
                    else:
                        self._source_problem = str(item)
                self._publish_statuses()
                self._show()
            for one in self._vehicles:
                one.status.put(encode(self._status(one, ENDED)))
        finally:
            if self._reader is not None:
                self._reader.close()
                self._reader.thread.join(RETRY)
            for one in self._vehicles:
                one.close()

    # ------------------------------------------------------------------ frames
    def _handle(self, frame: Frame) -> None:
        now = monotonic()
        self._last_frame_at = self._frames_due_at = now
        self._source_problem = ""
        self._frames.append(now)
        if frame.doubt:
            self._note, self._noted = frame.doubt, now
        self._handle_frame(frame, self._taken_ns(frame, now), now)

    def _handle_frame(self, frame: Frame, taken_ns: int | None, now: float) -> None:
        """Publish what may be flown on of a frame; `taken_ns` is from `_taken_ns`."""
        ours = {one.body for one in self._vehicles}
        first = sorted(frame.bodies, key=lambda body: body.name not in ours)[: OTHERS + len(ours)]
        bodies = [to_world(body, self._unit, self._up) for body in first]
        self._seen.extend((now, body.name) for body in bodies)
        names = Counter(body.name for body in bodies)
        for one in self._vehicles:
            if names[one.body]:
                self._handle_body(one, bodies, names[one.body], taken_ns, now)
        places = self._places | {body.name: body.position_w for body in bodies}
        self._places = dict(list(places.items())[-OTHERS:])  # a system may number them anew

    def _taken_ns(self, frame: Frame, now: float) -> int | None:
        """Return when a frame was taken, on the host's steady clock; None when that is doubtful."""
        if frame.stamp_ns is None:
            return frame.received_ns
        jumps = self._clock.jumps
        taken_ns = self._clock.host_ns(frame.stamp_ns, frame.received_ns)
        if self._clock.jumps != jumps:
            by = 1e-9 * self._clock.jump_ns
            self._note, self._noted = f"the clock of {self._name} was set by {by:+.3f} s", now
        if taken_ns is not None:
            self._latencies.append(1e-9 * (frame.received_ns - taken_ns))
        return taken_ns

    def _handle_body(
        self,
        one: TrackedVehicle,
        bodies: Iterable[Body],
        count: int,
        taken_ns: int | None,
        now: float,
    ) -> None:
        one.gaps += one.is_missing
        one.seen, one.is_missing, one.is_doubled = now, False, count > 1
        if one.is_doubled or taken_ns is None:
            return
        body = next(body for body in bodies if body.name == one.body)
        others = {name: place for name, place in self._places.items() if name != one.body}
        if not one.health.judge(body, 1e-9 * taken_ns, others):
            return
        stamp_ns = to_epoch(taken_ns)
        turn = NO_ATTITUDE if body.quaternion_wb is None else body.quaternion_wb
        sample = pose_sample(stamp_ns, body.position_w, turn)
        one.measurements.put(pose_messages(sample).tobytes(), stamp_ns)

    # ------------------------------------------------------------------ statuses
    def _publish_statuses(self) -> None:
        now = monotonic()
        while self._frames and now - self._frames[0] > RECENT:
            self._frames.popleft()
        while self._seen and now - self._seen[0][0] > RECENT:
            self._seen.popleft()
        is_due = now - self._status_at >= STATUS_PERIOD
        for one in self._vehicles:
            problem = self._problem(one, now)
            if _FIGURES.sub("", problem) == _FIGURES.sub("", one.shown_problem):
                problem = one.shown_problem  # the same except for figures
            if problem and problem != one.shown_problem:
                print(f"tracker: {one.vehicle}: {problem}", flush=True)
            self._print_figures(one, problem, now)
            if is_due or problem != one.shown_problem:
                one.shown_problem = problem
                one.status.put(encode(self._status(one, problem)))
        if is_due:
            self._status_at = now

    def _print_figures(self, one: TrackedVehicle, problem: str, now: float) -> None:
        """Print how well a camera sees, once it has worked without a problem for a while."""
        if problem:
            one.last_problem_at, one.has_printed_figures = now, False
        elif not one.has_printed_figures and now - one.last_problem_at > RECENT:
            one.has_printed_figures = True
            for view in self._views:
                text = figures_text(view.figures(), self.markers)
                print(f"tracker: {one.vehicle}: {text}", flush=True)

    def _show(self) -> None:
        """Publish each camera's newest picture if there are subscribers."""
        for k, view in enumerate(self._views):
            watched = [one for one in self._vehicles if one.pictures[k].has_subscribers]
            view.is_watched = bool(watched)
            newest = view.newest
            if newest is None or newest is self._shown[k]:
                continue
            self._shown[k], stamp_ns = newest, to_epoch(newest.taken_ns)
            for one in watched:
                payload = encode_picture(stamp_ns, newest.jpeg, one.vehicle)
                one.pictures[k].put(payload, stamp_ns)

    def _problem(self, one: TrackedVehicle, now: float) -> str:
        """Return the first cause of a problem of one vehicle; "" when there is none."""
        if self._source_problem:
            return self._source_problem
        note = self._note if now - self._noted < RECENT else ""
        if now < self._frames_due_at:
            return note
        if now - self._last_frame_at > GAP:
            return note or f"no frames from {self._name}; check the system and its network"
        one.is_missing = self._last_frame_at - one.seen > self.unseen_for
        if one.is_missing:
            return note or self._unseen(one)
        if one.is_doubled:
            return f"two bodies are called {one.body!r}; give each its own name in the system"
        return one.health.problem(now) or note

    def _unseen(self, one: TrackedVehicle) -> str:
        seen = sorted({name for _, name in self._seen})
        listed = ", ".join(seen[:LISTED_MAX]) + (", …" if len(seen) > LISTED_MAX else "")
        return f"no body {one.body!r} is seen; {self._name} shows {listed or 'none'}"

    def _status(self, one: TrackedVehicle, problem: str) -> TrackerStatus:
        rates = dict(Counter(name for _, name in self._seen).most_common(OTHERS))
        latencies = np.array(self._latencies or [0.0])
        bars = np.minimum(latencies / STEP, LATENCIES - 1).astype(int)
        return new(
            "quadlab_msgs/TrackerStatus",
            header=header(time_ns()),
            system=self._name,
            body=one.body,
            seen=list(rates),
            rates=np.array([count / RECENT for count in rates.values()]),
            frame_rate=len(self._frames) / RECENT,
            latency=float(np.median(latencies)),
            latency_p99=float(np.quantile(latencies, 0.99)),
            latency_counts=np.bincount(bars, minlength=LATENCIES).astype(np.uint32)
            * bool(self._latencies),
            clock_drift=self._clock.drift,
            gaps=one.gaps,
            jumps=one.health.jumps,
            clock_jumps=self._clock.jumps,
            problem=problem,
            withheld=bool(one.health.withheld) or one.is_doubled,
            cameras=[
                new("quadlab_msgs/CameraFigures", **view.figures()._asdict())
                for view in self._views
            ],
        )


def to_epoch(steady_ns: int) -> int:
    """Return an instant of the host's steady clock as a stamp of the station's clock."""
    return steady_ns + time_ns() - monotonic_ns()
