"""The drag of the whole vehicle, from circles in still air.

On a circle at a constant speed the velocity is at right angles to the acceleration: what a wrong
mass or weak motors are wrong by does not look like drag, and a steady wind is a constant.
"""

from __future__ import annotations

from pathlib import Path

from console.evaluation.drag import RAMP, read_drag
from console.evaluation.verdict import judged
from console.experiments.calibration_flight import CLEAR, come_down, missing_place
from console.experiments.client import Client, Result, VehicleView
from console.experiments.readings import Progress
from quadrotor.calibration_record import CalibrationRecord
from quadrotor.errors import RefusedError
from quadrotor.parameters import Parameters, parameter

STEPS = 3


class DragOptions(Parameters):
    """Options of the circles."""

    radius: float = parameter(0.8, unit="m", ge=0.4, le=2.0, step=0.1)
    """of the circle"""
    period: float = parameter(5.0, unit="s", ge=3.0, le=15.0, step=0.5)
    """of a lap: quicker shows more drag"""
    laps: int = parameter(5, ge=3, le=20, step=1)
    """laps, ramps included"""
    height: float = parameter(1.2, unit="m", ge=0.8, le=1.9, step=0.1)
    """of the circle"""


class DragExperiment:
    """Take-off, circles, landing; the coefficient from every tick."""

    name = "drag"

    def __init__(self, vehicle: str = "quad1") -> None:
        self.parameters = DragOptions()
        self._vehicle = vehicle

    @property
    def planned(self) -> float:
        """Return the planned time in s, about."""
        p = self.parameters
        return 25.0 + p.laps * p.period

    def check(self) -> None:
        """Accept all options: the vehicle refuses speeds that are too high."""

    def preconditions(self, view: VehicleView) -> str:
        """Return what is missing before it may start, as text."""
        return missing_place(view)

    def fly(self, client: Client) -> None:
        """Fly. Raises RefusedError with the vehicle's reason when it refuses."""
        p = self.parameters
        client.wait_until(lambda v: v.mode == "ready", what="the vehicle to be ready", timeout=20)
        client.confirm(CLEAR)
        client.wait(0.5)
        client.tell(Progress("Keep clear: it takes off on its own", 1, STEPS))
        client.arm()
        client.wait(1.0)
        try:
            client.start("take_off", height=p.height)
            client.wait_until(
                lambda v: v.behavior == "hover", what="hover after take-off", timeout=20
            )
            client.wait(2.0)
            client.tell(Progress("It flies circles: keep clear", 2, STEPS))
            client.start(
                "follow_trajectory",
                trajectory="circle",
                radius=p.radius,
                period=p.period,
                laps=p.laps,
                ramp=RAMP,
            )
            client.wait_until(
                lambda v: v.behavior == "hover" or client.finished,
                what="the end of the circles",
                timeout=p.laps * p.period + 20.0,
            )
            if client.view().behavior == "follow_trajectory":  # finished before its end
                client.start("brake")
                client.wait(2.0)
        except RefusedError:
            come_down(client)
            raise
        client.tell(Progress("It lands", STEPS, STEPS))
        come_down(client)

    def evaluate(self, log: Path) -> Result:
        """Judge the drag found. Raises LogFormatError without what it needs, MeasurementError
        without circles.
        """
        flight = read_drag(log, self._vehicle)
        return judged(flight.metrics(), flight.limits())

    def proposal(self, log: Path) -> CalibrationRecord:
        """Return the coefficient for model.drag. Raises as `evaluate`."""
        return read_drag(log, self._vehicle).record()
