"""The messages that the station receives from the vehicle, stored for a waiting experiment."""

from __future__ import annotations

import math
import threading
from contextlib import suppress

import numpy as np

from console.experiments.client import VehicleView
from console.parameters.vehicle import VehicleParameters
from quadrotor.errors import LinkError, UnknownParameterError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Array
from vehicle_link.clock import monotonic
from vehicle_link.messages import decode, stamp_of
from vehicle_link.messages.records import VehicleStatus
from vehicle_link.parameters.replica import MISSED
from vehicle_link.topics.table import TOPICS

OLD = 1.0
"""Age in s beyond which a status is too old to use."""


class VehicleFeed:
    """Written by the station's subscriptions, read by the experiment's thread.

    Attributes:
        news: a number that changes with every message.
    """

    def __init__(self, parameters: VehicleParameters) -> None:
        self._parameters = parameters
        self._news = threading.Condition()
        self.news = 0
        self._stamp_ns = 0
        self._position_w = np.zeros(3)
        self._status: VehicleStatus | None = None
        self._status_at = 0.0
        self._estimate: bytes | None = None
        self._mass = (math.nan, math.inf)  # kg, with its standard deviation

    # ------------------------------------------------------------------ input
    def telemetry(self, stamp_ns: int, position_w: Array) -> None:
        """Store the newest sample of a packet."""
        with self._news:
            self._stamp_ns, self._position_w = stamp_ns, position_w
            self.wake()

    def status(self, status: VehicleStatus) -> None:
        """Store a quadlab_msgs/VehicleStatus."""
        with self._news:
            self._status, self._status_at = status, monotonic()
            self.wake()

    def estimate(self, payload: bytes) -> None:
        """Store a received quadlab_msgs/EstimatorStatus; it is decoded only when it is read."""
        self._estimate = payload

    def applied(self, values: dict[str, ParameterValue], revision: int) -> None:
        """Wait for an announced change of the vehicle; `parameter` fetches it if it is missed."""
        replica = self._parameters
        with self._news:
            self._news.wait_for(
                lambda: all(replica.revision_of(name) >= revision for name in values), MISSED
            )

    def wake(self) -> None:
        """Wake all waiting threads to check their conditions again."""
        with self._news:
            self.news += 1
            self._news.notify_all()

    # ------------------------------------------------------------------ output
    @property
    def mode(self) -> str:
        """Return the vehicle's mode; empty when no status was received for a second."""
        with self._news:
            old = monotonic() - self._status_at > OLD
            return "" if self._status is None or old else str(self._status.mode).lower()

    def await_mode(self) -> str:
        """Return the vehicle's mode, if need be after a wait of a second for the next status.

        A base too busy to receive for a moment is thereby not mistaken for a silent vehicle.
        """
        with self._news:
            self._news.wait_for(lambda: self.mode, OLD)
            return self.mode

    @property
    def instance(self) -> int:
        """Return the instance of the vehicle's process in the newest status; 0 before it."""
        return 0 if self._status is None else int(self._status.instance)

    def view(self) -> VehicleView:
        """Return the present view. Raises LinkError before the first status."""
        mass, mass_deviation = self._flown_mass()
        with self._news:
            status = self._status
            if status is None:
                raise LinkError("no status of the vehicle has arrived yet")
            return VehicleView(
                time=self._stamp_ns * 1e-9,
                mode=str(status.mode).lower(),
                behavior=str(status.behavior).lower(),
                armed=bool(status.armed),
                airborne=bool(status.airborne),
                position_w=np.array(self._position_w),
                mass=mass,
                mass_deviation=mass_deviation,
            )

    def _flown_mass(self) -> tuple[float, float]:
        payload, self._estimate = self._estimate, None
        if payload is not None:
            with suppress(LinkError):  # the receiving part raises the alarm
                message = decode(payload, TOPICS["estimator"].type_name)
                variance = float(message.mass_variance)
                deviation = math.sqrt(variance) if variance >= 0.0 else math.inf
                self._mass = (float(message.mass), deviation)
        return self._mass

    def fetch(self) -> None:
        """Check that all parameters are known, as before a flight. Raises LinkError."""
        values, _, problem = self._parameters.snapshot()
        if problem or values is None:
            raise LinkError(f"the vehicle's parameters are not known: {problem or 'not read yet'}")

    def parameter(self, name: str) -> ParameterValue:
        """Return a parameter's value. Raises UnknownParameterError, or LinkError when a missed
        change cannot be fetched.
        """
        self._parameters.refresh()
        if (value := self._parameters.newest(name)) is None:
            raise UnknownParameterError(f"the vehicle has no parameter {name!r}")
        return value

    def wait_news(self, seen: int, timeout: float) -> None:
        """Wait until a message arrives after `seen`, at most `timeout` s."""
        with self._news:
            self._news.wait_for(lambda: self.news != seen, timeout)

    def wait_status(self, behavior: str, stamp_ns: int, timeout: float) -> None:
        """Wait until a status shows the behavior, or is not older than `stamp_ns` of the vehicle's
        clock.
        """
        with self._news:
            self._news.wait_for(
                lambda: (
                    self._status is not None
                    and (self._status.behavior == behavior or stamp_of(self._status) >= stamp_ns)
                ),
                timeout,
            )
