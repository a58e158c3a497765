"""The delay of the tracker's poses, and the pose of the tracked body on the vehicle.

The vehicle is turned by hand, motors off, from attitude to attitude without a rest; or it flies a
figure 8.
"""

from __future__ import annotations

import math
from contextlib import suppress
from pathlib import Path

from console.evaluation.verdict import judged
from console.experiments.calibration_flight import CLEAR, CalibrationFlight
from console.experiments.client import Client, Result
from console.experiments.manoeuvres import arm, fly_laps, landing_afterwards, take_off, wait_ready
from console.experiments.pose_guide import attitude_of, spread_poses, words_of
from console.experiments.readings import Progress
from extensions.identification.tracked_body.evaluation import TrackedBodyFound, read_tracked_body
from quadrotor.calibration_record import CalibrationRecord
from quadrotor.errors import QuadlabError, RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters, parameter

POSES = 12
TILT = math.radians(60.0)
EACH = 1.5
"""Seconds for which an attitude is requested."""
LAP = 6.0
"""Seconds of a lap."""


class TrackedBodyOptions(Parameters):
    """Options of both experiments."""

    method: str = parameter("hand", choices=("hand", "air"))
    """turned by hand, motors off; or in the air, a figure 8, which shows the lever arm less"""
    duration: float = parameter(60.0, unit="s", ge=15.0, le=600.0, step=5.0)
    """of the motion"""


class TrackerDelay(CalibrationFlight):
    """Finds the tracker's latency."""

    name = "tracker_delay"

    def __init__(self, vehicle: str = "quad1") -> None:
        self.parameters = TrackedBodyOptions()
        super().__init__(vehicle)

    @property
    def planned(self) -> float:
        """Return the approximate planned time in s."""
        return 15.0 + self.parameters.duration

    def fly(self, client: Client) -> None:
        """Guide a person who turns it, or fly. Raises RefusedError with the reason when neither is
        possible.
        """
        wait_ready(client)
        if self.parameters.method == "hand":
            self._turned_by_hand(client)
        else:
            self._flown(client)

    def _turned_by_hand(self, client: Client) -> None:
        ups = spread_poses(POSES, TILT)
        count = max(1, round(self.parameters.duration / EACH))
        try:
            for k in range(count):
                if client.finished:
                    break
                up = ups[k * 5 % POSES]  # 5 and 12 are coprime: all poses in turn, far apart
                client.turn(attitude_of(up))
                instruction = f"Keep it in the tracker's view and turn it to: {words_of(up)}"
                client.tell(Progress(instruction, k + 1, count, k / count))
                client.wait(EACH)
                view = client.view()
                if view.armed or view.mode != "ready":
                    raise RefusedError(
                        f"the vehicle is {view.mode}; motors must be off while it is held. Disarm "
                        "it and begin again"
                    )
            client.tell(Progress("Set the vehicle down, level", count, count, 1.0))
        finally:
            with suppress(QuadlabError):  # the reason for the end matters more
                client.turn(None)

    def _flown(self, client: Client) -> None:
        client.confirm(CLEAR)
        arm(client)
        laps = max(2, round(self.parameters.duration / LAP))
        with landing_afterwards(client, 2):
            take_off(client, 1.2)
            client.tell(Progress("It flies a figure 8: keep clear", 1, 2))
            eight: dict[str, ParameterValue] = {"trajectory": "figure_eight", "period": LAP}
            fly_laps(client, "the figure 8", laps * LAP + 20.0, laps=laps, **eight)

    def evaluate(self, log: Path) -> Result:
        """Judge the result. Raises LogFormatError without IMU or poses, MeasurementError with what
        is missing in the motion.
        """
        record = self.proposal(log)
        metrics = {one.name: one.value for one in (*record.figures, *record.quality)}
        limits = {one.name: one.limit for one in record.quality if one.limit is not None}
        return judged(metrics, limits)

    def proposal(self, log: Path) -> CalibrationRecord:
        """Return the record to accept. Raises as `evaluate` does."""
        return self._record(read_tracked_body(log, self._vehicle))

    def _record(self, found: TrackedBodyFound) -> CalibrationRecord:
        return found.delay_record()


class TrackerBody(TrackerDelay):
    """Finds where the tracker's rigid body sits on the vehicle."""

    name = "tracker_body"

    def _record(self, found: TrackedBodyFound) -> CalibrationRecord:
        return found.body_record()
