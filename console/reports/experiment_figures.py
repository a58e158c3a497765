"""The figures of an experiment: those of the paper, and those of calibrations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from console.reports.bench_steps import bench_of
from console.reports.calibration_figures import gyroscope, inertia, residuals
from console.reports.content import Picture
from console.reports.flight import Flight, airborne
from console.reports.judgement import Judgement
from console.reports.paper_figures import (
    mass_estimation,
    motor_calibration,
    state_estimation,
    trajectory_tracking,
)
from console.reports.plots import styled
from console.reports.run_log import RunLog
from console.reports.vibration_figures import vibration
from quadrotor.errors import LogFormatError, QuadlabError
from quadrotor.plain_rotations import rotation_vectors_between

Array = npt.NDArray[np.floating[Any]]


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


def _need(log: RunLog, *topics: str) -> None:
    absent = [topic for topic in topics if not log.has(topic)]
    if absent:
        raise LogFormatError(f"the log has no topic {', '.join(absent)}")


def _motor_bench(log: RunLog, flight: Flight, judged: Judgement) -> list[Picture]:
    _need(log, "bench_reading", "actuators")
    bench, summary = bench_of(log)
    caption = "Motor calibration: (a) input and output signals, (b) fitted model."
    return [
        Picture(
            "Fig. 2 of the paper",
            f"{caption} {summary}",
            "On the left motor reference, force and torque over time; on the right the reference "
            "over the force with the measured steps and the fitted curves.",
            3.9,
            styled(lambda figure: motor_calibration(figure, bench)),
        )
    ]


def _mass(log: RunLog, flight: Flight, judged: Judgement) -> list[Picture]:
    _need(log, "estimator")
    shown = flight.shown
    if shown is None:
        raise LogFormatError("the log has neither state nor truth nor tracker_pose")
    series = log.topics["estimator"]
    mass, variance = series.rows(("mass", "mass_variance")).T
    mass_curve = (series.time, mass, np.sqrt(np.maximum(variance, 0.0)))
    estimate = flight.estimate or shown
    simulated = log.parameters.get("simulator.mass")
    true_mass = judged.metrics.get("truth_kg")
    if true_mass is None and isinstance(simulated, int | float):
        true_mass = float(simulated)

    def draw(figure: Any) -> None:
        mass_estimation(
            figure,
            mass_curve,
            (shown.time, shown.position_w),
            (estimate.time, estimate.velocity_w),
            true_mass,
            airborne(log),
        )

    return [
        Picture(
            "Fig. 3 of the paper",
            "Mass estimation during a normal flight: (a) estimated mass, (b) position, "
            "(c) estimated velocity.",
            "Three plots over time: estimated mass with its deviation, position, velocity.",
            5.2,
            styled(draw),
        )
    ]


def _figure_eight(log: RunLog, flight: Flight, judged: Judgement) -> list[Picture]:
    _need(log, "reference")
    shown = flight.shown
    if shown is None:
        raise LogFormatError("the log has neither state nor truth nor tracker_pose")
    rows = _around(shown.time, log, "follow_trajectory")
    error, yaw_error = flight.tracking_error
    wanted = flight.reference[rows]
    yaw_wanted = wanted[:, 3]
    yaw = yaw_wanted + yaw_error[rows]  # next to its reference, without jumps

    def draw(figure: Any) -> None:
        trajectory_tracking(
            figure,
            shown.time[rows],
            shown.position_w[rows],
            wanted[:, :3],
            yaw,
            yaw_wanted,
            error[rows],
            yaw_error[rows],
            judged.windows,
        )

    return [
        Picture(
            "Fig. 4 of the paper",
            f"Tracking of an 8: (a) position ({shown.name}), (b) yaw, (c) position error, (d) yaw "
            "error, measured minus reference.",
            "Four plots over time: position with its reference, yaw with its reference, position "
            "error in x, y, z, yaw error.",
            4.4,
            styled(draw),
        )
    ]


def _bearings(log: RunLog, flight: Flight, judged: Judgement) -> list[Picture]:
    truth, estimate = flight.truth, flight.estimate
    if truth is None or estimate is None:
        raise LogFormatError("the log has no state, or neither truth nor tracker_pose")
    if not judged.windows:
        raise LogFormatError(
            "it never flew on bearings: no change of estimation.source to bearings"
        )
    (start, end), *_ = judged.windows
    rows = (truth.time >= start) & (truth.time <= end)
    time, angles = truth.time[rows], truth.angles[rows]
    estimated = angles - flight.estimation_error[2][rows]
    position = truth.position_w[rows], estimate.position_w[rows]
    error = flight.estimation_error[0][rows]
    off = rotation_vectors_between(estimate.quaternion_wb[rows], truth.quaternion_wb[rows])

    def draw(figure: Any) -> None:
        state_estimation(figure, time, position, (angles, estimated), error, off, (), truth.name)

    return [
        Picture(
            "Fig. 6 of the paper",
            f"State estimation on bearings alone, against {truth.name}: (a) position, (b) roll, "
            "pitch, yaw, (c) position error, (d) orientation error as a rotation vector.",
            "Four plots over time while bearings were flown on: true and estimated position, true "
            "and estimated angles, position error, orientation error.",
            4.6,
            styled(draw),
        )
    ]


def _around(time: Array, log: RunLog, behavior: str) -> npt.NDArray[np.bool_]:
    """Return the interval of that behaviour plus a second at both ends; all, if there is none."""
    spans = [one for one in log.spans("status", "behavior") if one[2] == behavior]
    if not spans:
        return np.ones(len(time), bool)
    rows: npt.NDArray[np.bool_] = (time >= spans[0][0] - 1.0) & (time <= spans[-1][1] + 1.0)
    return rows


Maker = Callable[[RunLog, Flight, Judgement], list[Picture]]
MAKERS: dict[str, Maker] = {
    "motor_bench": _motor_bench,
    "mass": _mass,
    "figure_eight": _figure_eight,
    "bearings": _bearings,
    "inertia": inertia,
    "accelerometer": residuals,
    "gyroscope": gyroscope,
    "vibration": vibration,
}
