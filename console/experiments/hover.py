"""Hover at 1 m for ten seconds: the smallest flight that shows whether a vehicle works."""

from __future__ import annotations

from pathlib import Path

from console.evaluation.tracking import tracking_errors
from console.evaluation.verdict import judged
from console.evaluation.world import read_world
from console.experiments.client import Client, Result
from console.experiments.manoeuvres import arm, land, take_off, wait_ready
from quadrotor.errors import RefusedError

DURATION = 10.0


class Hover:
    """Takes off to 1 m, hovers, lands; judged on the hover."""

    name = "hover"
    parameters = None
    planned = 25.0
    limits = {"position_rms_m": 0.005, "position_max_m": 0.010}  # noqa: RUF012

    def __init__(self, vehicle: str = "quad1") -> None:
        self._vehicle = vehicle
        self._window: tuple[float, float] | None = None

    def check(self) -> None:
        """Accept all options: every combination is valid."""

    def fly(self, client: Client) -> None:
        """Fly. Raises RefusedError with the vehicle's reason when it refuses."""
        wait_ready(client)
        arm(client)
        take_off(client, 1.0)
        client.wait(2.0)
        start = client.view().time
        client.wait_until(
            lambda v: v.time >= start + DURATION or client.finished,
            what="the end of the hover",
            timeout=DURATION + 5.0,
        )
        self._window = (start, client.view().time)
        land(client)

    def evaluate(self, log: Path) -> Result:
        """Judge the errors in hover against the limits. Raises LogFormatError, RefusedError."""
        if self._window is None:
            raise RefusedError("the hover was not flown to its end")
        metrics = tracking_errors(log, self._vehicle, *self._window).metrics()
        world = read_world(log)
        return judged(metrics | world.metrics(), world.widened(self.limits))
