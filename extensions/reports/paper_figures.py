"""Figs. 2, 3, 4 and 6 of the paper, with the sub-plots of their captions.

Times are in s, positions in m, angles in rad; unknown values are NaN.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from console.plots import (
    COLORS,
    DASHED,
    GOOD,
    REFERENCE,
    band,
    finish,
    grid,
    line,
    share_window,
    state_estimation,
    styled,
    triple,
    window,
)
from console.reports.bench_steps import fitted, signals
from console.reports.content import Picture
from console.reports.flight import Flight, airborne
from console.reports.judgement import Judgement
from console.reports.run_log import RunLog
from estimation.calibration.motor_law import USABLE
from quadrotor.errors import LogFormatError
from quadrotor.plain_rotations import rotation_vectors_between

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = npt.NDArray[np.floating]
NOT_TRACKED = "the log has neither state nor truth nor tracker_pose"


def motor_bench(log: RunLog, flight: Flight, judged: Judgement) -> list[Picture]:
    """Return Fig. 2: (a) input and output signals, (b) the fitted model as a function of force.

    Raises MeasurementError when no reference was held.
    """
    _need(log, "bench_reading", "actuators")
    signal, sensor = log.topics["actuators"], log.topics["bench_reading"]
    reference, force, torque, steps = signals(log)
    fits, summary = fitted(steps)
    used = (steps.reference >= USABLE[0]) & (steps.reference <= USABLE[1])

    def draw(figure: Figure) -> None:
        left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.25, 1.0))[0]
        axes = grid(left, 3)[:, 0]
        line(axes[0], signal.time, reference, color=GOOD, label="reference")
        finish(axes[0], "(a) reference", "counts", legend=False)
        line(axes[1], sensor.time, force, color=COLORS[0])
        finish(axes[1], "force", "N", legend=False)
        line(axes[2], sensor.time, 1e3 * torque, color=COLORS[1])
        finish(axes[2], "torque", "mN m", legend=False)
        axes[2].set_xlabel("s")
        axis = grid(right, 1)[0, 0]
        dots: Any = {"color": COLORS[0], "markersize": 4}
        axis.plot(steps.force[used], steps.reference[used], "o", **dots, label="measured")
        if not used.all():
            dots["markerfacecolor"] = "white"
            axis.plot(steps.force[~used], steps.reference[~used], "o", **dots, label="left out")
        styles = ((REFERENCE, "-"), (COLORS[1], (0, (4, 2))))
        for (name, curve), (color, style) in zip(fits.items(), styles, strict=False):
            axis.plot(*curve, color=color, linestyle=style, label=name)
        axis.set_xlabel("force, N")
        finish(axis, "(b) fitted model", "reference, counts", legend=False)
        axis.legend(loc="lower right")

    caption = "Motor calibration: (a) input and output signals, (b) fitted model."
    return [
        Picture(
            "Fig. 2 of the paper",
            f"{caption} {summary}",
            "On the left motor reference, force and torque over time; on the right the reference "
            "over the force with the measured steps and the fitted curves.",
            3.9,
            styled(draw),
        )
    ]


def mass(log: RunLog, flight: Flight, judged: Judgement) -> list[Picture]:
    """Return Fig. 3: (a) estimated mass, (b) position, (c) velocity."""
    _need(log, "estimator")
    shown = flight.shown
    if shown is None:
        raise LogFormatError(NOT_TRACKED)
    time = log.topics["estimator"].time
    value, variance = log.topics["estimator"].rows(("mass", "mass_variance")).T
    deviation = np.sqrt(np.maximum(variance, 0.0))
    known = np.isfinite(deviation) & (deviation < 0.3)
    estimate = flight.estimate or shown
    true_mass = judged.metrics.get("truth_kg", log.parameters.get("simulator.mass"))

    def draw(figure: Figure) -> None:
        axes = grid(figure, 3)[:, 0]
        axes[0].fill_between(
            time,
            value - deviation,
            value + deviation,
            where=known.tolist(),
            color=COLORS[0],
            alpha=0.18,
            linewidth=0,
            label="± its standard deviation",
            rasterized=len(time) > 4000,
        )
        line(axes[0], time, value, color=COLORS[0], label="estimated")
        if isinstance(true_mass, int | float) and np.isfinite(true_mass):
            axes[0].axhline(true_mass, **DASHED, label=f"true {true_mass:.4g} kg")
        finish(axes[0], "(a) mass", "kg")
        triple(axes[1], shown.time, shown.position_w)
        finish(axes[1], "(b) position", "m")
        triple(axes[2], estimate.time, estimate.velocity_w)
        finish(axes[2], "(c) velocity", "m/s")
        for axis in axes:
            window(axis, airborne(log))
        axes[2].set_xlabel("s (shaded: airborne)")

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


def figure_eight(log: RunLog, flight: Flight, judged: Judgement) -> list[Picture]:
    """Return Fig. 4: (a) position, (b) yaw, (c) position error, (d) yaw error."""
    _need(log, "reference")
    shown = flight.shown
    if shown is None:
        raise LogFormatError(NOT_TRACKED)
    rows = _around(shown.time, log, "follow_trajectory")
    time, wanted = shown.time[rows], flight.reference[rows]
    error, yaw_error = (one[rows] for one in flight.tracking_error)

    def draw(figure: Figure) -> None:
        axes = grid(figure, 2, 2)
        triple(axes[0, 0], time, shown.position_w[rows])
        band(axes[0, 0], time, wanted[:, :3], "reference")
        finish(axes[0, 0], "(a) position", "m", narrow=True)
        yaw = wanted[:, 3] + yaw_error  # next to its reference, without jumps
        line(axes[0, 1], time, np.degrees(yaw), color=COLORS[0], label="yaw")
        band(axes[0, 1], time, np.degrees(wanted[:, 3:]), "reference")
        finish(axes[0, 1], "(b) yaw", "°", narrow=True)
        triple(axes[1, 0], time, 1e3 * error)
        finish(axes[1, 0], "(c) position error", "mm", narrow=True)
        line(axes[1, 1], time, np.degrees(yaw_error), color=COLORS[0])
        finish(axes[1, 1], "(d) yaw error", "°", legend=False, narrow=True)
        share_window(axes, judged.windows)

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


def bearings(log: RunLog, flight: Flight, judged: Judgement) -> list[Picture]:
    """Return Fig. 6 of the time on bearings."""
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

    def draw(figure: Figure) -> None:
        state_estimation(
            figure=figure,
            time=time,
            position=position,
            angles=(angles, estimated),
            position_error=error,
            turn=off,
            judged=(),
            truth=truth.name,
        )

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


def _need(log: RunLog, *topics: str) -> None:
    absent = [topic for topic in topics if not log.has(topic)]
    if absent:
        raise LogFormatError(f"the log has no topic {', '.join(absent)}")


def _around(time: Array, log: RunLog, behavior: str) -> npt.NDArray[np.bool_]:
    """Return the interval of that behavior plus a second at both ends; all, if there is none."""
    spans = [one for one in log.spans("status", "behavior") if one[2] == behavior]
    if not spans:
        return np.ones(len(time), bool)
    rows: npt.NDArray[np.bool_] = (time >= spans[0][0] - 1.0) & (time <= spans[-1][1] + 1.0)
    return rows
