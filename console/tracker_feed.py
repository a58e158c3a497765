"""The simulated tracking system and the bearing emulator of the station, fed with the truth.

Measurements without delay leave in the truth's own callback; delayed ones from a thread.
Poses have the truth's stamps, which are of the vehicle's clock; frames of bearings are taken at
instants of their own on that clock, seen from the tracker's poses.
"""

from __future__ import annotations

import threading
from bisect import bisect_left
from collections import deque
from collections.abc import Callable

from bearing_sim import (
    BearingEmulator,
    BearingMeasurement,
    BearingParameters,
    PoseMeasurement,
    SimulatedTracker,
    TrackerParameters,
)
from quadrotor.plain_rotations import Array
from vehicle_link.clock import monotonic

RATE_WINDOW = 1.0
SHORTEST_WAIT = 0.0005
"""s; simulated time may stand still just before something is due."""


class TrackerFeed:
    """Thread-safe.

    Args:
        publish_pose, publish_bearings: called with each measurement when it is due, never two at
            once.
        clock: a steady clock in s.
    """

    def __init__(
        self,
        tracker: TrackerParameters,
        bearings: BearingParameters,
        publish_pose: Callable[[PoseMeasurement], None],
        publish_bearings: Callable[[BearingMeasurement], None],
        clock: Callable[[], float] = monotonic,
    ) -> None:
        self._tracker = SimulatedTracker(tracker)
        self._emulator = BearingEmulator(bearings)
        self._publish_pose, self._publish_bearings = publish_pose, publish_bearings
        self._clock = clock
        self._changed = threading.Condition()
        self._ahead_ns = 0  # truth's clock minus ours
        self._heard: float | None = None
        self._sent: deque[float] = deque(maxlen=1000)
        self._frames: deque[float] = deque(maxlen=1000)
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="tracker", daemon=True)
        self._thread.start()

    def truth(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        """Take one true pose: (3,) m, (4,) unit quaternion (w, x, y, z) body to world."""
        with self._changed:
            now = self._clock()
            self._heard = now
            self._ahead_ns = stamp_ns - round(now * 1e9)
            self._tracker.observe(stamp_ns, position_w, quaternion_wb)
            self._release(stamp_ns)
            if self._next_ns() is not None:
                self._changed.notify()

    @property
    def rate(self) -> float:
        """Return the poses sent in the last second, Hz."""
        return self._recent(self._sent)

    @property
    def bearings_rate(self) -> float:
        """Return the frames of bearings sent in the last second, Hz."""
        return self._recent(self._frames)

    @property
    def silence(self) -> float | None:
        """Return the seconds since the last truth, None before the first (no simulator, no tracking
        system).
        """
        return None if self._heard is None else self._clock() - self._heard

    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join(5.0)

    def _release(self, now_ns: int) -> None:
        for pose in self._tracker.due(now_ns):
            self._sent.append(self._clock())
            self._publish_pose(pose)
            self._emulator.observe(*pose)
        for frame in self._emulator.due(now_ns):
            self._frames.append(self._clock())
            self._publish_bearings(frame)

    def _recent(self, times: deque[float]) -> float:
        """Return the rate of times in order, Hz."""
        listed = list(times)  # at once: another thread adds to it
        return (len(listed) - bisect_left(listed, self._clock() - RATE_WINDOW)) / RATE_WINDOW

    def _next_ns(self) -> int | None:
        times = [t for t in (self._tracker.next_ns, self._emulator.next_ns) if t is not None]
        return min(times, default=None)

    def _run(self) -> None:
        with self._changed:
            while not self._closed:
                now_ns = round(self._clock() * 1e9) + self._ahead_ns
                self._release(now_ns)
                following = self._next_ns()
                wait = (
                    None if following is None else max(SHORTEST_WAIT, (following - now_ns) * 1e-9)
                )
                self._changed.wait(wait)
