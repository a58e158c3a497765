"""The newest messages from the vehicle, stored for the station's checks and decoded on demand."""

from __future__ import annotations

import math
import threading
from collections import deque
from typing import TYPE_CHECKING, Any, TypeVar, cast

from console.checks.body_turn import BodyTurn
from quadrotor.errors import LinkError
from quadrotor.plain_rotations import rotate, tilt_of
from quadrotor.records import Array, Record
from vehicle_link.clock import monotonic
from vehicle_link.messages import decode
from vehicle_link.messages.records import Message, VehicleStatus
from vehicle_link.topics.table import TOPICS

if TYPE_CHECKING:
    from vehicle_link.topics.typed_tables import Newest

T = TypeVar("T")

STALE = {"estimator": 0.5, "battery": 3.0, "status": 1.0, "telemetry": 0.5, "stick": 1.0}
"""Seconds after which a received message is too old to use."""
KEPT = ("estimator", "battery", "stick")
STILL_WINDOW = 0.5
"""Seconds for which the vehicle must have been at rest."""

Sample = tuple[float, Array, Array, Array, Array, Array]
"""Reception time (s); position (3,), velocity (3,), quaternion (4,), angular velocity (3,),
specific force (3,).
"""


class Observed:
    """The newest messages from subscriptions, for the checks."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._status: tuple[float, VehicleStatus] | None = None
        self._payloads: dict[str, tuple[float, bytes]] = {}
        self._samples: deque[Sample] = deque(maxlen=100)
        self._turn = BodyTurn()
        self.newest = cast("Newest", self._decoded)
        """Return the decoded message, or None when it is missing, too old or invalid."""

    # ------------------------------------------------------------------ input
    def status(self, status: VehicleStatus) -> None:
        """Store a quadlab_msgs/VehicleStatus."""
        self._status = (monotonic(), status)

    def message(self, name: str, payload: bytes) -> None:
        """Store a received message of `estimator`, `battery` or `stick` from any sender."""
        if name in KEPT:
            self._payloads[name] = (monotonic(), payload)

    def telemetry(self, tick: Record) -> None:
        """Store the newest TICK of a packet."""
        state = tick["state"]
        sample = (
            monotonic(),
            state["position_w"],
            state["velocity_w"],
            state["quaternion_wb"],
            state["angular_velocity_b"],
            tick["imu"]["specific_force_b"],
        )
        with self._lock:
            self._samples.append(sample)
        if self._status is not None and not self._status[1].armed:
            self._turn.update(sample[0], *sample[3:])

    # ------------------------------------------------------------------ output
    def newest_status(self) -> VehicleStatus | None:
        return self._fresh("status", self._status)

    def _decoded(self, name: str) -> Message | None:
        payload = self._fresh(name, self._payloads.get(name))
        if payload is None:
            return None
        try:
            return decode(payload, TOPICS[name].type_name)
        except LinkError:
            return None

    @property
    def deflection(self) -> float:
        """Return the deflection of the most deflected stick, 0..1; 0 when no sticks are sent."""
        sticks = self.newest("stick")
        return 0.0 if sticks is None else max((abs(float(x)) for x in sticks.axes), default=0.0)

    def motion(self) -> dict[str, Any]:
        """Return the motion as fields of `Facts`; empty when there is no fresh telemetry."""
        with self._lock:
            samples = list(self._samples)
        now = monotonic()
        if not samples or now - samples[-1][0] > STALE["telemetry"]:
            return {}
        recent = [one for one in samples if now - one[0] <= STILL_WINDOW]
        _, position, _, quaternion, _, _ = samples[-1]
        # On plain numbers: with arrays of three numbers this takes five times as long.
        forces_w = [rotate(one[3].tolist(), one[5].tolist()) for one in recent]
        up = [sum(axis) for axis in zip(*forces_w, strict=True)]
        return {
            "position_w": tuple(float(x) for x in position),
            "gravity_off": math.atan2(math.hypot(*up[:2]), up[2]) if any(up) else None,
            "body_turn": self._turn.angle,
            "tilt": tilt_of(*map(float, quaternion)),
            "speed": sum(math.hypot(*one[2].tolist()) for one in recent) / len(recent),
            "body_rate": sum(math.hypot(*one[4].tolist()) for one in recent) / len(recent),
        }

    def _fresh(self, name: str, kept: tuple[float, T] | None) -> T | None:
        if kept is None or monotonic() - kept[0] > STALE[name]:
            return None
        return kept[1]
