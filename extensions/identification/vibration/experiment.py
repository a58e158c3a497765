"""The noise of the IMU at rest and in hover, as the error-state filter should assume it."""

from __future__ import annotations

from pathlib import Path

from console.experiments.calibration_flight import CLEAR, CalibrationFlight, CalibrationResult
from console.experiments.client import Client
from console.experiments.manoeuvres import landing_afterwards, take_off, wait_ready
from console.experiments.readings import Progress
from extensions.identification.vibration.evaluation import (
    HOVER_MIN,
    REST_MIN,
    SETTLE,
    read_vibration,
)
from quadrotor.parameters import Parameters, parameter

STEPS = 4


class VibrationOptions(Parameters):
    """Options of rest and hover."""

    rest: float = parameter(20.0, unit="s", ge=REST_MIN + 1.0, le=600.0, step=1.0)
    """on the ground, motors off: the longer, the smaller a bias walk is seen"""
    hover: float = parameter(20.0, unit="s", ge=HOVER_MIN + 1.0, le=120.0, step=1.0)
    """in the air"""
    height: float = parameter(1.0, unit="m", ge=0.6, le=1.9, step=0.1)
    """of the hover"""


class VibrationExperiment(CalibrationFlight):
    """Rest, take-off, hover, landing; the noise from every tick."""

    name = "vibration"

    def __init__(self, vehicle: str = "quad1") -> None:
        self.parameters = VibrationOptions()
        super().__init__(vehicle)

    @property
    def planned(self) -> float:
        """Return the approximate planned time in s."""
        return 20.0 + self.parameters.rest + self.parameters.hover

    def fly(self, client: Client) -> None:
        """Fly. Raises RefusedError with the vehicle's reason when it refuses."""
        p = self.parameters
        wait_ready(client)
        client.confirm(CLEAR)
        self._wait(client, "Leave it standing still", 1, p.rest)
        client.tell(Progress("Keep clear: it takes off on its own", 2, STEPS))
        client.arm()
        client.wait(1.0)
        with landing_afterwards(client, STEPS):
            take_off(client, p.height)
            self._wait(client, "It hovers: keep clear", 3, p.hover + SETTLE)

    def _wait(self, client: Client, words: str, number: int, seconds: float) -> None:
        start = client.view().time
        while (past := client.view().time - start) < seconds and not client.finished:
            client.tell(Progress(words, number, STEPS, past / seconds))
            client.wait(0.2)

    def found(self, log: Path) -> CalibrationResult:
        """Return the noise for estimation.error_state.*."""
        return read_vibration(log, self._vehicle)
