"""Experiments of plans whose flights see the truth: they are judged by it, and not by the log."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from benchmarks.flights.watched_flight import Observed
from console.evaluation.flight_checks import IMPACT, LIMITS
from console.evaluation.verdict import judged
from console.experiments.client import Result
from quadrotor.errors import MeasurementError
from quadrotor.parameters import Parameters

ANY = 100.0
"""Limit of what such flights are about: emergencies, and times for which the vehicle reports that
something is wrong."""


class Watching:
    """An experiment that keeps what its flight has found as its figures.

    Attributes:
        flight: the kind of flight that it needs. found: figures, and limits of some of them.
    """

    flight: type[Observed] = Observed
    parameters: Parameters | None = None
    planned = 40.0

    def __init__(self) -> None:
        self.found: dict[str, float] = {}
        self.limits: dict[str, float] = {}

    def check(self) -> None: ...

    def evaluate(self, log: Path) -> Result:
        """Return the result of the flight that this object has flown.

        Raises MeasurementError for the log of another one.
        """
        if not self.found:
            raise MeasurementError("its figures are of the truth, which only its flight sees")
        result = judged(self.found, self.limits)
        expected = {name: ANY for name in LIMITS if name != IMPACT}
        return replace(result, limits=expected | self.limits)
