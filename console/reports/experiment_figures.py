"""The figures of each experiment: those of the paper, and those of calibrations."""

from __future__ import annotations

from collections.abc import Callable

from console.reports.calibration_figures import gyroscope, inertia, residuals
from console.reports.content import Picture
from console.reports.flight import Flight
from console.reports.judgement import Judgement
from console.reports.paper_figures import bearings, figure_eight, mass, motor_bench
from console.reports.run_log import RunLog
from console.reports.vibration_figures import vibration
from quadrotor.errors import QuadlabError

MAKERS: dict[str, Callable[[RunLog, Flight, Judgement], list[Picture]]] = {
    "motor_bench": motor_bench,
    "mass": mass,
    "figure_eight": figure_eight,
    "bearings": bearings,
    "inertia": inertia,
    "accelerometer": residuals,
    "gyroscope": gyroscope,
    "vibration": vibration,
}


def experiment_pictures(
    log: RunLog, flight: Flight, judged: Judgement
) -> tuple[list[Picture], list[str]]:
    """Return the figures, and why any are missing."""
    maker = MAKERS.get(judged.experiment)
    if maker is None:
        return [], []
    try:
        return maker(log, flight, judged), []
    except QuadlabError as error:
        return [], [f"No figures of {judged.experiment}: {error}"]
