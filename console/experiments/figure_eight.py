"""The 8-shape of Sec. 7: 1 m x 1 m in 8 s laps, z ± 0.2 m, yaw ± 1 rad.

It is flown in steady laps at a constant rate between ramps, or from rest to rest in one lap of the
same 8 s, which tilts the vehicle four times as far and is judged from beginning to end.
"""

from __future__ import annotations

from pathlib import Path

from console.evaluation.tracking import tracking_errors
from console.evaluation.verdict import judged
from console.evaluation.world import read_world
from console.experiments.client import Client, Result
from console.experiments.manoeuvres import arm, brake, land, take_off, wait_ready
from flight_log.summary import summarize
from quadrotor.errors import RefusedError, UsageError
from quadrotor.parameters import Parameters, parameter

LAPS = 3
MIKROKOPTER = "mikrokopter"
PERIOD = 8.0
RAMP = 4.0
"""Seconds, longer than the trajectory's ramp in or out: only steady laps remain in between."""


STEADY, REST_TO_REST = "steady", "rest_to_rest"
LIMITS = {
    STEADY: {"position_rms_m": 0.005, "position_max_m": 0.009, "yaw_rms_deg": 0.4},
    REST_TO_REST: {"position_rms_m": 0.020, "position_max_m": 0.040, "yaw_rms_deg": 1.0},
}
"""Limits of the errors of the true position and yaw relative to the reference."""
BY_RATES = {"position_rms_m": 0.025, "position_max_m": 0.050, "yaw_rms_deg": 1.0}
"""Limits of steady laps on a board that receives body rates: its inner loop is not ours."""
ACCELERATION, STEEP = "behavior.trajectory_acceleration_max", 5.2
"""Parameter, and a value in m/s²: one lap in 8 s needs 5.0, more than the vehicle
usually allows."""
YAW_MAX = 0.7
"""Yaw in rad beyond which one lap from rest to rest needs more yaw torque than the motors have
left."""


class FigureEightOptions(Parameters):
    """Options of the 8."""

    laps: str = parameter(
        STEADY,
        choices=(STEADY, REST_TO_REST),
        description=f"{LAPS} laps between ramps, judged on the steady part; or rest to rest in one "
        f"lap, with a yaw amplitude of at most {YAW_MAX:g} rad",
    )
    yaw_amplitude: float = parameter(1.0, unit="rad", ge=0.0, le=1.5, step=0.1)
    """of the yaw, to both sides"""


class FigureEight:
    """Takes off to 1 m, flies the 8, lands; judged on the steady laps, or on the one lap."""

    name = "figure_eight"
    planned = 50.0

    def __init__(self, vehicle: str = "quad1") -> None:
        self.parameters = FigureEightOptions()
        self._vehicle = vehicle
        self._window: tuple[float, float] | None = None

    def check(self) -> None:
        """Raise UsageError for a yaw that one lap from rest to rest cannot have."""
        p = self.parameters
        if p.laps == REST_TO_REST and p.yaw_amplitude > YAW_MAX + 1e-9:
            raise UsageError(
                f"yaw amplitude {p.yaw_amplitude:g} rad needs too much yaw torque in one lap from "
                f"rest to rest: at most {YAW_MAX:g} rad; 0.2 rad is usual"
            )

    def fly(self, client: Client) -> None:
        """Fly. Raises RefusedError with the vehicle's reason when it refuses, or as
        `check` does.
        """
        self.check()
        one_lap = self.parameters.laps == REST_TO_REST
        wait_ready(client)
        arm(client)
        take_off(client, 1.0)
        client.wait(3.0)
        start = client.view().time
        try:
            self._start(client)
        except RefusedError:
            land(client)
            raise
        longest = (LAPS + 2) * PERIOD + 10
        client.wait_until(
            lambda v: v.behavior == "hover" or client.finished,
            what="the end of the 8",
            timeout=longest,
        )
        ramp = 0.0 if one_lap else RAMP
        self._window = (start + ramp, client.view().time - ramp)
        if client.view().behavior == "follow_trajectory":  # finished early: no ramp out
            self._window = (start + ramp, client.view().time)
            brake(client)
        client.wait(1.0)
        land(client)

    def _start(self, client: Client) -> None:
        """Start the trajectory. The vehicle checks its limits at the start, so they are widened
        only then.
        """
        yaw = self.parameters.yaw_amplitude
        if self.parameters.laps == STEADY:
            client.start(
                "follow_trajectory",
                trajectory="figure_eight",
                laps=LAPS,
                period=PERIOD,
                yaw_amplitude=yaw,
            )
            return
        usual = client.parameter(ACCELERATION)
        client.change({ACCELERATION: max(float(usual), STEEP)})
        try:
            client.start(
                "follow_trajectory", trajectory="figure_eight_lap", period=PERIOD, yaw_amplitude=yaw
            )
        finally:
            client.change({ACCELERATION: usual})

    def evaluate(self, log: Path) -> Result:
        """Judge the errors on the steady laps against the limits. Raises LogFormatError,
        RefusedError.
        """
        if self._window is None:
            raise RefusedError(
                "the figure 8 was not flown to its end, so there is nothing to evaluate"
            )
        metrics = tracking_errors(log, self._vehicle, *self._window).metrics()
        board = summarize(log).run.get("board", MIKROKOPTER)
        is_ours = board == MIKROKOPTER or self.parameters.laps == REST_TO_REST
        world, limits = read_world(log), LIMITS[self.parameters.laps] if is_ours else BY_RATES
        return judged(metrics | world.metrics(), world.widened(limits))
