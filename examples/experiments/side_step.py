"""Measure the overshoot of a step to the side: `quadlab fly examples/experiments/side_step.py --set
experiment.length=0.8`. The page lists it from the folder `experiments` of the data folder.
"""

from pathlib import Path

from console.evaluation.log_columns import read_columns
from console.evaluation.verdict import judged
from console.experiments.client import Client, Result, VehicleView
from quadrotor.parameters import Parameters, parameter


class Options(Parameters):
    length: float = parameter(0.5, unit="m", ge=0.1, le=1.0, step=0.1)
    """of the step, to the left"""


class SideStep:
    """Take off, step to the left and land; judge the overshoot."""

    name, planned = "side_step", 25.0  # s

    def __init__(self, vehicle: str = "quad1") -> None:
        self.parameters, self._vehicle = Options(), vehicle

    def check(self) -> None: ...  # raises UsageError for options that do not fit each other

    def preconditions(self, view: VehicleView) -> str:
        """Return why the experiment may not begin, or ""; called once the vehicle is ready."""
        return "" if abs(view.position_w[1]) < 0.5 else "put the vehicle near y = 0 first"

    def abort(self, view: VehicleView) -> str:
        """Return why the experiment must end, or ""; called repeatedly during every wait."""
        return "over 2 m away from the middle" if abs(view.position_w[1]) > 2.0 else ""

    def fly(self, client: Client) -> None:
        """Fly the step. A command that the vehicle refuses raises RefusedError with its reason."""
        client.wait_until(lambda v: v.mode == "ready", what="the vehicle to be ready", timeout=20)
        client.wait(0.5)
        client.arm()
        client.wait(1.0)
        client.start("take_off", height=1.0)
        client.wait_until(lambda v: v.behavior == "hover", what="hover after take-off", timeout=20)
        client.wait(2.0)
        begin = client.view()
        self._target = float(begin.position_w[1]) + self.parameters.length
        client.start("fly_to", y=self._target, speed=0.8)
        client.wait(5.0)
        self._window = (begin.time, client.view().time)  # s
        client.start("land")
        client.wait_until(lambda v: not v.armed, what="touch-down", timeout=20)

    def evaluate(self, log: Path) -> Result:
        """Judge the flight from the log, in another process, which has what `fly` has set."""
        y = ("pose.pose.position.y",)
        truth = read_columns(log, self._vehicle, {"truth": y})["truth"]
        over = truth.table(y, *self._window)[:, 0] - self._target
        metrics = {"overshoot_m": max(0.0, float(over.max())), "end_error_m": abs(float(over[-1]))}
        return judged(metrics, {"overshoot_m": 0.05, "end_error_m": 0.02})
