"""The common part of calibration flights: confirmation before take-off, and landing at the end."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np

from console.evaluation.verdict import judged
from console.experiments.client import Client, Result, VehicleView
from quadrotor.calibration_record import CalibrationRecord
from quadrotor.parameters import ParameterValue

CLEAR = (
    "The motors start and the vehicle takes off on its own. Is everybody clear of it, with 2 m of "
    "room on each side?"
)
LANDING = 30.0
"""Seconds for the landing."""


class Found(Protocol):
    """The result of a calibration, read from its log."""

    def metrics(self) -> dict[str, float]: ...

    def limits(self) -> dict[str, float]: ...

    def record(self) -> CalibrationRecord: ...


class CalibrationFlight:
    """The common part of the experiments that fly automatically and evaluate every tick of the log.

    Args:
        vehicle: its name.
    """

    def __init__(self, vehicle: str = "quad1") -> None:
        self._vehicle = vehicle

    def found(self, log: Path) -> Found:
        """Return the result from the log alone. Raises LogFormatError when data are missing,
        MeasurementError when the flight does not determine it.
        """
        raise NotImplementedError

    def check(self) -> None:
        """Accept all options: the vehicle refuses what it cannot fly."""

    def preconditions(self, view: VehicleView) -> str:
        """Return as text what is missing before the flight may start."""
        return missing_place(view)

    def evaluate(self, log: Path) -> Result:
        """Judge the result. Raises as `found` does."""
        found = self.found(log)
        return judged(found.metrics(), found.limits())

    def proposal(self, log: Path) -> CalibrationRecord:
        """Return the record to accept. Raises as `found` does."""
        return self.found(log).record()


def take_off(client: Client, height: float) -> None:
    """Take off and wait until the vehicle hovers. Raises RefusedError."""
    client.start("take_off", height=height)
    client.wait_until(lambda v: v.behavior == "hover", what="hover after take-off", timeout=20)


def fly_laps(client: Client, what: str, patience: float, **laps: ParameterValue) -> None:
    """Fly a trajectory to its end, or brake when the experiment is to end. Raises RefusedError."""
    client.start("follow_trajectory", **laps)
    client.wait_until(
        lambda v: v.behavior == "hover" or client.finished,
        what=f"the end of {what}",
        timeout=patience,
    )
    if client.view().behavior == "follow_trajectory":  # finished before its end
        client.start("brake")
        client.wait(2.0)


def missing_place(view: VehicleView) -> str:
    """Return as text why the flight may not begin; empty when it may."""
    if not np.isfinite(view.position_w).all():
        return "the vehicle does not know where it is; check the tracker"
    return ""


def come_down(client: Client) -> None:
    """Land if in flight, and wait until the motors are off. Raises RefusedError."""
    view = client.view()
    if view.mode == "armed" and view.behavior not in ("ground", "land"):
        client.start("land")
    if view.armed and view.behavior != "ground":
        client.wait_until(lambda v: not v.armed, what="touch-down", timeout=LANDING)
    client.wait(0.5)
