"""Fly a behavior of one's own: the references of the plugin that `behavior.plugin` names."""

from __future__ import annotations

from pathlib import Path

from console.evaluation.tracking import tracking_errors
from console.evaluation.verdict import judged
from console.experiments import manoeuvres
from console.experiments.client import Client, Result
from quadrotor.errors import RefusedError
from quadrotor.parameters import Parameters, parameter

PLUGIN = "behavior.plugin"
SETTLE = 3.0  # s, for brake and hover


class Options(Parameters):
    """Options of the experiment."""

    duration: float = parameter(30.0, unit="s", ge=1.0, le=600.0, step=1.0)
    """longest time of the behavior, which may end by itself before"""


class OwnBehavior:
    """Takes off to 1 m, starts the behavior, lands after it; judged on how it was followed."""

    name = "own_behavior"
    limits = {"disengaged": 0.0, "position_rms_m": 0.05, "position_max_m": 0.15}  # noqa: RUF012

    def __init__(self, vehicle: str = "quad1") -> None:
        self.parameters = Options()
        self._vehicle = vehicle
        self._window: tuple[float, float] | None = None
        self._disengaged = 0.0

    @property
    def planned(self) -> float:
        """Return the longest duration of the flight in s."""
        return 20.0 + self.parameters.duration

    def check(self) -> None:
        """Accept all options: every combination is valid."""

    def fly(self, client: Client) -> None:
        """Fly. Raises RefusedError with the vehicle's reason when it refuses."""
        manoeuvres.wait_ready(client)
        manoeuvres.arm(client)
        manoeuvres.take_off(client, 1.0)
        client.wait(2.0)
        chosen = client.parameter(PLUGIN)
        client.start("external")
        start = client.view().time
        end = start + self.parameters.duration
        client.wait_until(
            lambda v: v.time >= end or v.behavior in ("brake", "hover") or client.finished,
            what="the end of the behavior",
            timeout=self.parameters.duration + 5.0,
        )
        self._window = (start, client.view().time)
        client.start("brake")
        client.wait(SETTLE)
        self._disengaged = float(client.parameter(PLUGIN) != chosen)
        manoeuvres.land(client)

    def evaluate(self, log: Path) -> Result:
        """Judge the errors against the limits. Raises LogFormatError, RefusedError."""
        if self._window is None or self._window[1] - self._window[0] < 0.5:
            raise RefusedError("the behavior ended immediately; the run's events say why")
        metrics = tracking_errors(log, self._vehicle, *self._window).metrics()
        flown = {"behavior_s": self._window[1] - self._window[0], "disengaged": self._disengaged}
        return judged(flown | metrics, self.limits)
