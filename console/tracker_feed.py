"""The poses and bearings that the station sends, from one tracker at a time.

The tracker is the simulated tracking system, fed with the truth, unless a tracker process
(console.trackers) is running. Bearings are emulated, unless a process reads a camera on board.
Measurements without delay are sent in the callback of their input; delayed ones from a thread.
Poses have stamps of the vehicle's clock, as the truth has; emulated frames of bearings are taken at
their own instants on that clock, as seen from the tracker's poses.
"""

from __future__ import annotations

import threading
from bisect import bisect_left
from collections import deque
from collections.abc import Callable

from bearing_sim.emulator import BearingEmulator, BearingMeasurement, BearingParameters
from bearing_sim.pose_measurement import PoseMeasurement
from bearing_sim.tracker import SimulatedTracker, TrackerParameters
from quadrotor.plain_rotations import Array
from quadrotor.records import has_attitude
from vehicle_link.clock import monotonic
from vehicle_link.messages.records import TrackerStatus

ENDED = "its process was ended"
"""Problem in the last status of a tracker process that was ended on purpose."""
RATE_WINDOW = 1.0
SILENT, PROCESS_SILENT, STARTING = 1.0, 0.4, 10.0
"""Seconds without a truth, or without the tracker process's status, until it is reported; seconds
that the process has to start."""
SHORTEST_WAIT = 0.0005
"""Shortest wait in s; simulated time may stop just before something is due."""


class TrackerFeed:
    """Sends poses and bearings when they are due; thread-safe.

    Args:
        publish_pose, publish_bearings: called with each measurement when it is due, never two at
            once.
        clock: a steady clock in s.
        follows_process: whether poses are to come from a tracker process.

    Attributes:
        follows_process: poses come, or have come, from a tracker process; the simulated tracker is
            then off for good.
    """

    def __init__(
        self,
        tracker: TrackerParameters,
        bearings: BearingParameters,
        publish_pose: Callable[[PoseMeasurement], None],
        publish_bearings: Callable[[BearingMeasurement], None],
        clock: Callable[[], float] = monotonic,
        *,
        follows_process: bool = False,
    ) -> None:
        self.follows_process = follows_process
        self._parameters, self._bearings = tracker, bearings
        self._tracker = SimulatedTracker(tracker)
        self._emulator = BearingEmulator(bearings)
        self._publish_pose, self._publish_bearings = publish_pose, publish_bearings
        self._clock = clock
        self._changed = threading.Condition()
        self._ahead_ns = 0  # vehicle's clock minus ours
        self._truth_at: float | None = None
        self._sent: deque[float] = deque(maxlen=1000)
        self._frames: deque[float] = deque(maxlen=1000)
        self._process: TrackerStatus | None = None  # its newest TrackerStatus
        self._status_at = clock() + STARTING
        self._camera: TrackerStatus | None = None  # the newest TrackerStatus of the camera on board
        self._camera_status_at = 0.0
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="tracker", daemon=True)
        self._thread.start()

    def truth(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        """Handle one true pose: (3,) m, (4,) unit quaternion (w, x, y, z) body to world."""
        with self._changed:
            if self.follows_process:
                return
            self._truth_at = self._clock()
            self._tracker.observe(stamp_ns, position_w, quaternion_wb)
            self._catch_up(stamp_ns)

    def tracked(self, pose: PoseMeasurement, now_ns: int) -> None:
        """Handle a pose of a tracker process. `now_ns` is the present time of its clock, the
        vehicle's.
        """
        with self._changed:
            self._send(pose)
            self._catch_up(now_ns)

    def note_tracker_status(self, status: TrackerStatus) -> None:
        """Handle a TrackerStatus of the tracker process."""
        self.follows_process, self._process, self._status_at = True, status, self._clock()

    def seen(self, frame: BearingMeasurement) -> None:
        """Handle a frame of a camera on board, stamped with the vehicle's clock."""
        with self._changed:
            self._frames.append(self._clock())
            self._publish_bearings(frame._replace(beacons=self._emulator.beacons))

    def note_camera_status(self, status: TrackerStatus) -> None:
        """Handle a TrackerStatus of the camera on board, which replaces the emulated bearings."""
        self._camera, self._camera_status_at = status, self._clock()

    def forget_ended_camera(self) -> bool:
        """Emulate bearings again if the process of the camera on board was ended on purpose; return
        whether it was. Called while the vehicle is disarmed: in flight the source must not change.
        """
        if self._camera is None or self._camera.problem != ENDED:
            return False
        self._camera = None
        return True

    @property
    def camera_alarm(self) -> str | None:
        """Return what is wrong with the camera on board, or None."""
        if self._camera is None:
            return None
        if self._clock() - self._camera_status_at > PROCESS_SILENT:
            return "camera on board: its process is silent; restart it, or check its output"
        return f"camera on board: {self._camera.problem}" if self._camera.problem else None

    @property
    def alarm(self) -> str | None:
        """Return what is wrong with the tracker, or None."""
        if self.follows_process:
            if self._clock() - self._status_at > PROCESS_SILENT:
                return "tracker: its process is silent; start quadlab tracker, or check its output"
            problem = "" if self._process is None else self._process.problem
            return f"tracker: {problem}" if problem else None
        if self._truth_at is None or self._clock() - self._truth_at <= SILENT:
            return None  # before the first truth: neither simulator nor tracking system
        return "tracker: the simulator no longer sends true poses"

    @property
    def nominal(self) -> float:
        """Return the expected rate of poses, Hz."""
        if self.follows_process:
            return 0.0 if self._process is None else float(self._process.frame_rate)
        return self._parameters.rate * (1.0 - self._parameters.drop_out)

    @property
    def rate(self) -> float:
        """Return the poses sent in the last second, Hz."""
        return self._recent(self._sent)

    @property
    def bearings_nominal(self) -> float:
        """Return the expected rate of bearings frames, Hz."""
        camera = self._camera
        return self._bearings.rate if camera is None else float(camera.frame_rate)

    @property
    def bearings_rate(self) -> float:
        """Return the rate of bearings frames sent in the last second, Hz."""
        return self._recent(self._frames)

    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join(5.0)

    def _catch_up(self, now_ns: int) -> None:
        self._ahead_ns = now_ns - round(self._clock() * 1e9)
        self._release(now_ns)
        if self._next_ns() is not None:
            self._changed.notify()

    def _send(self, pose: PoseMeasurement) -> None:
        self._sent.append(self._clock())
        self._publish_pose(pose)
        if has_attitude(pose.quaternion_wb) and self._camera is None:
            self._emulator.observe(*pose)

    def _release(self, now_ns: int) -> None:
        for pose in self._tracker.due(now_ns):
            self._send(pose)
        for frame in self._emulator.due(now_ns):
            if self._camera is None:
                self._frames.append(self._clock())
                self._publish_bearings(frame)

    def _recent(self, times: deque[float]) -> float:
        """Return the rate of the newest of these ordered times, Hz."""
        listed = list(times)  # copied in one step: another thread appends to it
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
