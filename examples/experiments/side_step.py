"""Measure how far a vehicle overshoots a step to the side: an example of a user's experiment.

Fly it in simulated time with `quadlab fly examples/experiments/side_step.py`, options as
`--set experiment.length=0.8`; or copy it to the folder `experiments` of the data folder, and the
page lists it next to the built-in ones. One file holds one class like the one below.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from console.evaluation.log_columns import read_columns
from console.evaluation.verdict import judged
from console.experiments.client import Client, Result, VehicleView
from quadrotor.errors import RefusedError
from quadrotor.parameters import Parameters, parameter

SETTLE = 4.0  # s
FAR = 2.0  # m


class Options(Parameters):
    """Options of the experiment; units and bounds apply to the page and to `--set`."""

    length: float = parameter(0.5, unit="m", ge=0.1, le=1.0, step=0.1)
    """of the step, to the left"""
    speed: float = parameter(0.8, unit="m/s", ge=0.1, le=2.0, step=0.1)
    """largest, on the way"""


class SideStep:
    """Take off, step to the left and land; judge the overshoot."""

    name = "side_step"
    planned = 25.0  # s

    def __init__(self, vehicle: str = "quad1") -> None:
        self.parameters = Options()
        self._vehicle = vehicle
        self._window = (0.0, 0.0)  # s, vehicle clock
        self._start = 0.0  # m

    def check(self) -> None:
        """Raise UsageError for options that do not fit each other; these always do."""

    def preconditions(self, view: VehicleView) -> str:
        """Return why the experiment may not begin, or ""; called once the vehicle is ready."""
        return "" if abs(view.position_w[1]) < 0.5 else "put the vehicle near y = 0 first"

    def abort(self, view: VehicleView) -> str:
        """Return why the experiment must end, or ""; called repeatedly during every wait."""
        far = math.hypot(view.position_w[0], view.position_w[1])
        return f"{far:.1f} m away from the middle, allowed {FAR:g}" if far > FAR else ""

    def fly(self, client: Client) -> None:
        """Fly the step. A command that the vehicle refuses raises RefusedError with its reason."""
        client.wait_until(lambda v: v.mode == "ready", what="the vehicle to be ready", timeout=20)
        client.wait(0.5)
        client.arm()
        client.wait(1.0)
        client.start("take_off", height=1.0)
        client.wait_until(lambda v: v.behavior == "hover", what="hover after take-off", timeout=20)
        client.wait(2.0)
        self._start = float(client.view().position_w[1])
        begin = client.view().time
        target = self._start + self.parameters.length
        client.start("fly_to", y=target, speed=self.parameters.speed)
        client.wait(self.parameters.length / self.parameters.speed + SETTLE)
        self._window = (begin, client.view().time)
        client.start("land")
        client.wait_until(lambda v: not v.armed, what="touch-down", timeout=20)
        client.wait(0.5)

    def evaluate(self, log: Path) -> Result:
        """Judge the flight from the log alone.

        This runs in another process, which has the attributes that `fly` has set.
        """
        if self._window == (0.0, 0.0):
            raise RefusedError("the step was not flown")
        path = "pose.pose.position.y"
        truth = read_columns(log, self._vehicle, {"truth": (path,)})["truth"]
        y = truth.table((path,), *self._window)[:, 0]
        target = self._start + self.parameters.length
        metrics = {
            "overshoot_m": float(np.maximum(y - target, 0.0).max()),
            "end_error_m": float(abs(y[-1] - target)),
        }
        limits = {"overshoot_m": 0.05, "end_error_m": 0.02}
        return judged(metrics, limits)
