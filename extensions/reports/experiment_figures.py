"""The figures of each experiment: those of the paper, and those of calibrations."""

from __future__ import annotations

from collections.abc import Callable

from console.reports.content import Picture
from console.reports.flight import Flight
from console.reports.judgement import Judgement
from console.reports.run_log import RunLog
from extensions.reports.calibration_figures import gyroscope, inertia, residuals
from extensions.reports.paper_figures import bearings, figure_eight, mass, motor_bench
from quadrotor.errors import QuadlabError
from quadrotor.extension import ReportFigures
from quadrotor.extensions import registry

Maker = Callable[[RunLog, Flight, Judgement], list[Picture]]

MAKERS: dict[str, Maker] = {
    "motor_bench": motor_bench,
    "mass": mass,
    "figure_eight": figure_eight,
    "bearings": bearings,
    "inertia": inertia,
    "inertia_optimal": inertia,
    "accelerometer": residuals,
    "gyroscope": gyroscope,
}


def experiment_pictures(
    log: RunLog, flight: Flight, judged: Judgement
) -> tuple[list[Picture], list[str]]:
    """Return the figures, and why any are missing."""
    try:
        maker = _maker(judged.experiment)
        return ([] if maker is None else maker(log, flight, judged)), []
    except QuadlabError as error:
        return [], [f"No figures of {judged.experiment}: {error}"]


def _maker(experiment: str) -> Maker | None:
    """Return the maker of an experiment's figures. Raises UsageError if it cannot be imported."""
    offered = registry().offers(ReportFigures, taken=MAKERS).get(experiment)
    return MAKERS.get(experiment) if offered is None else offered.load()
