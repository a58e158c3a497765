"""The 8-shape of Sec. 7: 1 m x 1 m in 8 s laps, z ± 0.2 m, yaw ± 1 rad."""

from __future__ import annotations

from pathlib import Path

from console.experiments.client import Client, Result
from console.experiments.tracking import tracking_errors
from quadrotor.errors import RefusedError

LAPS = 3
PERIOD = 8.0
RAMP = 4.0
"""s, longer than the trajectory's ramp in or out: what is left between are steady laps."""


class FigureEight:
    """Takes off to 1 m, flies the 8 for some laps, lands; judged on the steady laps."""

    name = "figure_eight"
    parameters = None
    planned = 50.0
    limits = {"position_rms_m": 0.005, "position_max_m": 0.009, "yaw_rms_deg": 0.4}  # noqa: RUF012

    def __init__(self, vehicle: str = "quad1") -> None:
        self._vehicle = vehicle
        self._window: tuple[float, float] | None = None

    def check(self) -> None:
        """Nothing can be chosen wrongly."""

    def fly(self, client: Client) -> None:
        """Raises RefusedError with the vehicle's reason when it will not."""
        client.wait_until(lambda v: v.mode == "ready", what="the vehicle to be ready", timeout=20)
        client.wait(0.5)
        client.arm()
        client.wait(1.0)
        client.start("take_off", height=1.0)
        client.wait_until(lambda v: v.behavior == "hover", what="hover after take-off", timeout=20)
        client.wait(3.0)
        start = client.view().time
        client.start("follow_trajectory", trajectory="figure_eight", laps=LAPS, period=PERIOD)
        longest = (LAPS + 2) * PERIOD + 10
        client.wait_until(
            lambda v: v.behavior == "hover" or client.finished,
            what="the end of the 8", timeout=longest,
        )  # fmt: skip
        self._window = (start + RAMP, client.view().time - RAMP)
        if client.view().behavior == "follow_trajectory":  # finished before its end: no ramp out
            self._window = (start + RAMP, client.view().time)
            client.start("brake")
            client.wait(2.0)
        client.wait(1.0)
        client.start("land")
        client.wait_until(lambda v: not v.armed, what="touch-down", timeout=20)
        client.wait(0.5)

    def evaluate(self, log: Path) -> Result:
        """Errors on the steady laps against the limits. Raises LogFormatError, RefusedError."""
        if self._window is None:
            raise RefusedError("the 8 was not flown to its end, so there is nothing to evaluate")
        metrics = tracking_errors(log, self._vehicle, *self._window).metrics()
        passed = all(metrics[name] <= limit for name, limit in self.limits.items())
        return Result("passed" if passed else "failed", metrics, dict(self.limits))
