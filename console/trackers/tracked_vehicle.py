"""One vehicle of a tracker process: its publishers, and the state of its body."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from console.trackers.health import BodyHealth
from quadrotor.errors import RefusedError
from vehicle_link.clock import monotonic
from vehicle_link.messages import decode
from vehicle_link.termination_signal import Ending
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received

if TYPE_CHECKING:
    from vehicle_link.transport.loopback import Session
LISTENING = 0.5
"""Seconds of listening before the start: another process with the same poses sends five statuses in
this time."""


class TopicNames(NamedTuple):
    """Topics of a vehicle's measurements, of their process's status, and of a camera's pictures."""

    measurements: str
    status: str
    pictures: tuple[str, ...]


class TrackedVehicle:
    """One vehicle's body: its publishers and its health."""

    def __init__(self, session: Session, vehicle: str, body: str, topics: TopicNames) -> None:
        self.vehicle, self.body = vehicle, body
        self.health = BodyHealth()
        self.seen = monotonic()
        self.gaps = 0
        self.is_missing = self.is_doubled = False
        self.shown_problem = ""
        self.last_problem_at, self.has_printed_figures = self.seen, False
        self._node = Node(session, f"/{vehicle}", "tracker")
        self.measurements = self._node.advertise(TOPICS[topics.measurements])
        self.status = self._node.advertise(TOPICS[topics.status])
        self.pictures = [self._node.advertise(TOPICS[one]) for one in topics.pictures]

    def close(self) -> None:
        self._node.close()


def check_alone(
    session: Session, vehicles: Sequence[TrackedVehicle], status: str, stopping: Ending
) -> None:
    """Check that no other process sends a status on this topic for one of the vehicles. Raises
    RefusedError.
    """
    others: list[str] = []

    def received(vehicle: str, message: Received) -> None:
        system = decode(message.payload, TOPICS["tracker_status"].type_name).system
        others.append(
            f"a process for {system} already sends the poses or bearings of {vehicle}; stop it "
            "first, or choose another vehicle"
        )

    listener = Node(session, "", "tracker_listener")
    for one in vehicles:
        topic = f"/{one.vehicle}/{status}"
        listener.subscribe(topic, TOPICS[status].type_name, partial(received, one.vehicle))
    stopping.wait(LISTENING)
    listener.close()
    if others:
        raise RefusedError(others[0])
