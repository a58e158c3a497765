"""Collection of the facts for the checks from the parts of the station."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

from console.checks.facts import Facts
from console.checks.observed import Observed
from console.context import StationContext
from console.parameters.vehicle import VehicleParameters
from console.runs.disk import folder_problem
from console.tracker_feed import TrackerFeed
from control.behaviors.parameters import flight_volume, keep_out
from quadrotor.parameter_description import ParameterValue
from vehicle_link.clock import monotonic
from vehicle_link.messages.records import LinkStatus, Vector3

JUDGED = ("sticks", "tracker")
"""Alarms that have their own line in the list."""
NOTICES = ("catalogue", "beacons", "history", "disk", "trash", "stick")
"""Alarms that do not prevent a flight."""


class Gatherer:
    """Collects the facts from the station's parts.

    Args:
        folder: of the station's runs.
        sticks_dropped: returns whether the stick watchdog has dropped the sticks.

    Attributes:
        link_status: the newest quadlab_msgs/LinkStatus that the station sent.
    """

    def __init__(
        self,
        context: StationContext,
        observed: Observed,
        tracker: TrackerFeed,
        vehicle: VehicleParameters,
        folder: Path,
        sticks_dropped: Callable[[], bool],
    ) -> None:
        self._link, self._station = context.link, context.parameters
        self._recorder, self._alarms = context.recorder, context.alarms
        self._observed, self._tracker, self._vehicle = observed, tracker, vehicle
        self._folder, self._sticks_dropped = folder, sticks_dropped
        self._in_step: float | None = None
        self.link_status: LinkStatus | None = None

    def note_link_status(self, status: LinkStatus) -> None:
        """Store the newest quadlab_msgs/LinkStatus."""
        self.link_status = status

    def facts(self) -> Facts:
        """Return the present facts; reads the state of the disk."""
        status, observed = self._observed.newest_status(), self._observed
        board, recorder = self._alarms.keyed(), self._recorder.status()
        noticed = [line for key, line in board.items() if key in NOTICES]
        estimator, battery = observed.newest("estimator"), observed.newest("battery")
        return Facts(
            link=self._link.state(),
            clock_known=self._link.clock_known,
            telemetry_rate=self.link_status.telemetry_rate if self.link_status else 0.0,
            loss=self.link_status.loss if self.link_status else 0.0,
            mode=None if status is None else str(status.mode).lower(),
            armed=status is not None and bool(status.armed),
            airborne=status is not None and bool(status.airborne),
            flags=frozenset(str(flag).lower() for flag in status.flags) if status else frozenset(),
            tick_rate=0.0 if status is None else float(status.tick_rate),
            nominal_rate=(0.0 if status is None else float(status.nominal_rate)) or 500.0,
            missed_share=0.0 if status is None else float(status.missed_share),
            position_innovation=_length(estimator.position_innovation) if estimator else None,
            attitude_innovation=_length(estimator.attitude_innovation) if estimator else None,
            consistency=float(estimator.consistency) if estimator else math.nan,
            refused_share=float(estimator.refused_share) if estimator else math.nan,
            pose_age=float(estimator.measurement_age) if estimator else None,
            voltage=float(battery.voltage) if battery else None,
            tracker_rate=self._tracker.rate,
            bearings_rate=self._tracker.bearings_rate,
            bearings_nominal=max(1.0, self._tracker.bearings_nominal),
            tracker_nominal=max(1.0, self._tracker.nominal),
            battery_warning=_number(self._vehicle.newest("safety.battery_warning")),
            volume=flight_volume(self._vehicle.newest),
            boxes=keep_out(self._vehicle.newest),
            parameters_behind=self._behind(),
            free_bytes=recorder.free_bytes,
            keep_free=1e6 * self._station.recorder.keep_free,
            folder_problem=folder_problem(self._folder),
            alarms=tuple(x for k, x in board.items() if k not in (*JUDGED, *NOTICES)),
            notices=tuple(dict.fromkeys((*noticed, *recorder.alarms))),
            deflection=observed.deflection,
            sticks_dropped=self._sticks_dropped(),
            **observed.motion(),
        )

    def _behind(self) -> float | None:
        """Return the seconds since our copy last matched the vehicle's parameters, or None."""
        now = monotonic()
        if self._vehicle.in_step:
            self._in_step = now
        return None if self._in_step is None else now - self._in_step


def _number(value: ParameterValue | None) -> float | None:
    return float(value) if isinstance(value, int | float) else None


def _length(vector: Vector3) -> float:
    """Return the length of a geometry_msgs/Vector3."""
    return math.hypot(vector.x, vector.y, vector.z)
