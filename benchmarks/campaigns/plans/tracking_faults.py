"""A tracking system that fails in the middle of a flight, for half a second or permanently.

The vehicle hovers or flies the figure 8 on the poses of `console.trackers`, the process's own code
without its sockets: frames of a system with its own clock, drifting and read with jitter.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, ClassVar
from unittest import mock

import numpy as np

from bearing_sim.pose_measurement import PoseMeasurement
from bearing_sim.tracker import SimulatedTracker
from benchmarks.campaigns.watching import Watching
from benchmarks.flights.watched_flight import Observed
from console.trackers import process, tracked_vehicle
from console.trackers.source import Body, Frame
from quadrotor.parameters import Parameters, parameter
from quadrotor.plain_rotations import Array, turned
from vehicle_link.messages import decode
from vehicle_link.topics.measurements import decode_pose

SECONDS = 12.0
"""Time, in s, for which a flight is watched after the fault: enough to land from 1 m."""
SHORT = 0.6
"""Duration, in s, of a short fault: longer than its report takes, shorter than pose_land_after."""
HARD = 1.0
"""Speed at the ground, in m/s, beyond which a landing is a crash."""
PLANE = 0.1
"""Least distance, in m, from the plane of a mirror, on which nothing would jump."""
AHEAD_NS, DRIFT, JITTER = 3_000_000_000_000, 40e-6, 0.001
OTHER = np.array([1.5, -1.0, 0.8])
"""Place of another body, m."""
Fault = Callable[["System", float, list[Body]], list[Body] | None]


def _silent(system: System, past: float, bodies: list[Body]) -> None:
    return None


def _lost(system: System, past: float, bodies: list[Body]) -> list[Body]:
    return bodies[1:]


def _dropped(system: System, past: float, bodies: list[Body]) -> list[Body] | None:
    return None if system.chance.random() < 0.3 else bodies


def _flipped(system: System, past: float, bodies: list[Body]) -> list[Body]:
    own = bodies[0]
    assert own.quaternion_wb is not None
    return [own._replace(quaternion_wb=turned(own.quaternion_wb, (0, 0, np.pi / 2))), *bodies[1:]]


def _mirrored(system: System, past: float, bodies: list[Body]) -> list[Body]:
    return [one._replace(position_w=one.position_w * (-1, 1, 1)) for one in bodies]


def _swapped(system: System, past: float, bodies: list[Body]) -> list[Body]:
    return [bodies[0]._replace(name=bodies[1].name), bodies[1]._replace(name=bodies[0].name)]


def _set(seconds: int) -> Fault:
    def jump(system: System, past: float, bodies: list[Body]) -> list[Body]:
        system.ahead_ns = AHEAD_NS + seconds * 1_000_000_000
        return bodies

    return jump


FAULTS: dict[str, tuple[Fault, float, bool]] = {
    "server killed, back after 0.6 s": (_silent, SHORT, True),
    "server killed": (_silent, SECONDS, False),
    "body lost for 0.6 s": (_lost, SHORT, True),
    "body lost": (_lost, SECONDS, False),
    "30 % of the frames dropped": (_dropped, SECONDS, True),
    "stamps jump by +1 s": (_set(1), SECONDS, True),
    "stamps jump by -1 s": (_set(-1), SECONDS, True),
    "axes flipped by 90° for 0.6 s": (_flipped, SHORT, True),
    "axes flipped by 90°": (_flipped, SECONDS, False),
    "mirrored along x, 0.1 m or more from its plane": (_mirrored, SECONDS, False),
    "bodies swapped": (_swapped, SECONDS, False),
}
"""Faults: function, duration (s), and whether the vehicle should fly on rather than land."""


class _Node:
    """Unconnected node: its publications are stored by topic."""

    sent: ClassVar[dict[str, list[bytes]]] = {}

    def __init__(self, *_: Any) -> None: ...

    def advertise(self, topic: Any) -> Any:
        kept = self.sent.setdefault(topic.name, [])
        return mock.Mock(put=lambda payload, *_: kept.append(payload))


class System:
    """A tracking system and its process, in place of a flight's simulated tracker."""

    def __init__(self, tracker: SimulatedTracker, seed: int) -> None:
        self.parameters = tracker.parameters
        self.chance = np.random.default_rng((seed, 77))
        self.ahead_ns, self.failed_ns = AHEAD_NS, 0
        self.fault: Fault | None = None
        self.seconds, self.reported = 0.0, float("inf")
        self._inner = tracker
        self._now_ns = 0
        self._under_way: deque[tuple[int, int, list[Body]]] = deque()
        _Node.sent.clear()
        clock: dict[str, Any] = {
            "monotonic": lambda: 1e-9 * self._now_ns,
            "monotonic_ns": lambda: self._now_ns,
            "time_ns": lambda: self._now_ns,
            "print": lambda *_, **__: None,
        }
        self._patch = mock.patch.dict(vars(process), clock)
        with self._patch, mock.patch.object(tracked_vehicle, "Node", _Node):
            self._process = process.Tracker("vrpn", mock.Mock(), {"quad1": "cf7"}, mock.Mock())

    def fail(self, fault: Fault, seconds: float, now_ns: int) -> None:
        self.fault, self.seconds, self.failed_ns = fault, seconds, now_ns
        self.reported = float("inf")

    def observe(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        self._inner.observe(stamp_ns, position_w, quaternion_wb)
        for pose in self._inner.due(stamp_ns):
            bodies: list[Body] | None = [Body("cf7", pose.position_w, pose.quaternion_wb)]
            bodies.append(Body("wand", OTHER, np.array([1.0, 0, 0, 0])))  # type: ignore[union-attr]
            past = 1e-9 * (stamp_ns - self.failed_ns)
            if self.fault is not None and past < self.seconds:
                bodies = self.fault(self, past, bodies)  # type: ignore[arg-type]
            late = 2_000_000 + round(1e9 * self.chance.exponential(JITTER))
            if bodies is not None:
                taken_ns = round((1 - DRIFT) * pose.stamp_ns) + self.ahead_ns
                self._under_way.append((stamp_ns + late, taken_ns, bodies))

    def due(self, now_ns: int) -> list[PoseMeasurement]:
        self._now_ns = now_ns
        with self._patch:
            while self._under_way and self._under_way[0][0] <= now_ns:
                received_ns, taken_ns, bodies = self._under_way.popleft()
                self._process._handle(Frame(taken_ns, received_ns, tuple(bodies)))
            self._process._publish_statuses()
        for payload in _Node.sent["tracker_status"]:
            if self.fault and decode(payload, "quadlab_msgs/TrackerStatus").problem:
                self.reported = min(self.reported, 1e-9 * (now_ns - self.failed_ns))
        _Node.sent["tracker_status"].clear()
        found = [decode_pose(payload)[0] for payload in _Node.sent["tracker_body"]]
        _Node.sent["tracker_body"].clear()
        return [
            PoseMeasurement(int(one["stamp_ns"]), one["position_w"], one["quaternion_wb"])
            for one in found
        ]

    @property
    def next_ns(self) -> int | None:
        return self._under_way[0][0] if self._under_way else None


class TrackingOptions(Parameters):
    """Options: the fault, and what is flown."""

    fault: str = parameter(next(iter(FAULTS)), choices=tuple(FAULTS))
    """of the tracking system"""
    manoeuvre: str = parameter("hover", choices=("hover", "figure_eight"))
    """before and after it"""
    watched: float = parameter(SECONDS, unit="s", ge=1.0, le=60.0)
    """from the fault on"""


class TrackingFaults(Watching):
    """A flight on a tracking system that fails."""

    name = "tracking_faults"

    def __init__(self) -> None:
        super().__init__()
        self.parameters: TrackingOptions = TrackingOptions()

    def fly(self, client: Observed) -> None:
        """Fly, have the system fail, and watch what the vehicle does."""
        options = self.parameters
        fault, seconds, goes_on = FAULTS[options.fault]
        seed = client.parameters.simulator.seed
        system = System(client._tracker, seed)
        client._poses = system
        client.hover()
        if options.manoeuvre == "figure_eight":
            client.start("follow_trajectory", trajectory="figure_eight", laps=3)
        else:  # away from the planes and the axis of symmetry, where mirroring changes nothing
            client.start("fly_to", x=0.6, y=-0.4, z=1.0)
        client.wait(5.0 + float(system.chance.uniform(0.0, 1.0)))
        while fault is _mirrored and abs(client.robot.truth["position_w"][0, 0]) < PLANE:
            client.advance()
        client.forget()
        system.fail(fault, seconds, client.stack.stamp_ns)
        client.wait(options.watched)
        _, places, wanted = client.trace()
        flies = client.view().airborne and client.airborne
        safe = client.hardest < HARD and client.most_tilted < 1.0
        self.found = {
            "as_meant": float(safe and flies == goes_on),
            "hardest_m_s": client.hardest,
            **({"reported_s": system.reported} if fault is not _dropped else {}),
        }
        if goes_on:
            self.found["error_m"] = float(np.linalg.norm(places - wanted, axis=1).max())
        self.limits = {"hardest_m_s": HARD}
