"""One vehicle of a tracker process: its publishers, and the state of its body."""

from __future__ import annotations

from typing import Any

from console.trackers.health import BodyHealth
from vehicle_link.clock import monotonic
from vehicle_link.topics import TOPICS
from vehicle_link.transport.node import Node


class Vehicle:
    """One vehicle's body: its publishers and its health.

    Args:
        measured, told, shown: topics of its measurements, of its status, and of a camera's
            pictures.
    """

    def __init__(
        self, session: Any, vehicle: str, body: str, measured: str, told: str, shown: str
    ) -> None:
        self.vehicle, self.body = vehicle, body
        self.health = BodyHealth()
        self.seen = monotonic()
        self.gaps = 0
        self.is_missing = self.is_doubled = False
        self.told = ""
        self.troubled, self.is_well_told = self.seen, False
        self._node = Node(session, f"/{vehicle}", "tracker")
        self.measured = self._node.advertise(TOPICS[measured])
        self.status = self._node.advertise(TOPICS[told])
        self.picture = self._node.advertise(TOPICS[shown])

    def close(self) -> None:
        self._node.close()
