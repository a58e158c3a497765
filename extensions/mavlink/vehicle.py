"""The vehicle as the station reports it, decoded once for all messages that are made of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, cast

from quadrotor.plain_rotations import roll_pitch_yaw, rotate
from vehicle_link.clock import monotonic_ns
from vehicle_link.messages import decode, stamp_of
from vehicle_link.messages.records import Message, Odometry, VehicleStatus
from vehicle_link.topics.table import TOPICS

if TYPE_CHECKING:
    from vehicle_link.topics.typed_tables import Newest

STALE_NS = {"battery": 5_000_000_000}
"""Age (ns) at which a message counts as none; of the others:"""
USUALLY_NS = 1_500_000_000

NewestPayload = Callable[[], tuple[bytes, int] | None]
Vector = tuple[float, float, float]


class Source(Protocol):
    """The part of `quadlab.station_client.StationClient` that is used."""

    def newest_payload(self, topic: str) -> NewestPayload: ...


@dataclass(frozen=True, slots=True)
class Motion:
    """The estimate: position and velocity in the world, quaternion_wb, angular velocity in body."""

    stamp_ns: int
    position_w: Vector
    quaternion_wb: tuple[float, float, float, float]
    velocity_b: Vector
    angular_velocity_b: Vector

    @property
    def velocity_w(self) -> Vector:
        return rotate(self.quaternion_wb, self.velocity_b)

    @property
    def yaw(self) -> float:
        return roll_pitch_yaw(*self.quaternion_wb)[2]


class Vehicle:
    """The newest state, status and battery of the vehicle, as the station publishes them."""

    def __init__(self, source: Source) -> None:
        names = ("state", "status", "battery", "control", "preflight", "reference")
        self._newest = {name: source.newest_payload(name) for name in names}
        self._decoded: dict[str, tuple[bytes, Message]] = {}
        self.message = cast("Newest", self._message)
        self._motion: tuple[Odometry, Motion] | None = None

    def _message(self, topic: str) -> Message | None:
        """Return the newest message of a topic; None while there is none that is fresh."""
        newest = self._newest[topic]()
        if newest is None or monotonic_ns() - newest[1] > STALE_NS.get(topic, USUALLY_NS):
            return None
        known = self._decoded.get(topic)
        if known is None or known[0] is not newest[0]:
            known = newest[0], decode(newest[0], TOPICS[topic].type_name)
            self._decoded[topic] = known
        return known[1]

    def payload(self, topic: str) -> tuple[bytes, int] | None:
        """Return the newest message, encoded, and when it was received (ns)."""
        return self._newest[topic]()

    @property
    def status(self) -> VehicleStatus | None:
        return self.message("status")

    @property
    def behavior(self) -> str:
        """Return the present behavior, "" while the vehicle is not heard."""
        status = self.status
        return "" if status is None else str(status.behavior)

    @property
    def holder(self) -> str:
        """Return who has control, "" for no one."""
        control = self.message("control")
        return "" if control is None else str(control.holder)

    @property
    def motion(self) -> Motion | None:
        """Return the newest estimate."""
        odometry = self.message("state")
        if odometry is None:
            return None
        if self._motion is None or self._motion[0] is not odometry:
            pose, twist = odometry.pose.pose, odometry.twist.twist
            turn = pose.orientation
            motion = Motion(
                stamp_of(odometry),
                (pose.position.x, pose.position.y, pose.position.z),
                (turn.w, turn.x, turn.y, turn.z),
                (twist.linear.x, twist.linear.y, twist.linear.z),
                (twist.angular.x, twist.angular.y, twist.angular.z),
            )
            self._motion = odometry, motion
        return self._motion[1]
