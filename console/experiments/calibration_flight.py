"""The common part of calibration flights: the question before take-off, and the judgement."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np

from console.evaluation.verdict import judged
from console.experiments.client import Result, VehicleView
from quadrotor.calibration_record import CalibrationRecord

CLEAR = (
    "The motors start and the vehicle takes off on its own. Is everybody clear of it, with 2 m of "
    "room on each side?"
)


class CalibrationResult(Protocol):
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

    def found(self, log: Path) -> CalibrationResult:
        """Return the result from the log alone. Raises LogFormatError when data are missing,
        MeasurementError when the flight does not determine it.
        """
        raise NotImplementedError

    def check(self) -> None:
        """Accept all options: the vehicle refuses what it cannot fly."""

    def preconditions(self, view: VehicleView) -> str:
        """Return why the flight may not begin, as text; empty when it may."""
        if not np.isfinite(view.position_w).all():
            return "the vehicle does not know where it is; check the tracker"
        return ""

    def evaluate(self, log: Path) -> Result:
        """Judge the result. Raises as `found` does."""
        found = self.found(log)
        return judged(found.metrics(), found.limits())

    def proposal(self, log: Path) -> CalibrationRecord:
        """Return the record to accept. Raises as `found` does."""
        return self.found(log).record()
