"""The drag of the whole vehicle, from circles in still air.

On a circle at constant speed the velocity is perpendicular to the acceleration: the effects of a
wrong mass or weak motors do not look like drag, and a steady wind is a constant.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from console.experiments.calibration_flight import CLEAR, CalibrationFlight, CalibrationResult
from console.experiments.client import Client
from console.experiments.manoeuvres import arm, fly_laps, landing_afterwards, take_off, wait_ready
from console.experiments.readings import Progress
from extensions.identification.drag.evaluation import RAMP, read_drag
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


@dataclass(frozen=True, slots=True)
class Circles:
    """Circles at one speed: radius (m), time of a lap (s), and number of laps, ramps included."""

    radius: float
    period: float
    laps: int


class CircledFlight(CalibrationFlight):
    """The common part: take-off, circles, landing; the coefficient from every tick."""

    def fly_circles(self, client: Client, circles: Circles, height: float) -> None:
        """Fly. Raises RefusedError with the vehicle's reason when it refuses."""
        wait_ready(client)
        client.confirm(CLEAR)
        client.tell(Progress("Keep clear: it takes off on its own", 1, STEPS))
        arm(client)
        with landing_afterwards(client, STEPS):
            take_off(client, height)
            client.wait(2.0)
            client.tell(Progress("It flies circles: keep clear", 2, STEPS))
            patience = circles.laps * circles.period + 20.0
            how = {"trajectory": "circle", "ramp": RAMP, **asdict(circles)}
            fly_laps(client, "the circles", patience, **how)

    def found(self, log: Path) -> CalibrationResult:
        """Return the drag found in the log."""
        return read_drag(log, self._vehicle)


class DragExperiment(CircledFlight):
    """Circles as the options say."""

    name = "drag"

    def __init__(self, vehicle: str = "quad1") -> None:
        super().__init__(vehicle)
        self.parameters = DragOptions()

    @property
    def planned(self) -> float:
        """Return the approximate planned time in s."""
        p = self.parameters
        return 25.0 + p.laps * p.period

    def fly(self, client: Client) -> None:
        """Fly. Raises RefusedError with the vehicle's reason when it refuses."""
        p = self.parameters
        self.fly_circles(client, Circles(p.radius, p.period, p.laps), p.height)
