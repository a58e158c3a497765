"""Figures of calibrations that the paper shows no figure of: gyroscope, accelerometer, inertia."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from console.evaluation.inertia import read_inertia
from console.plots import AXES, COLORS, DASHED, QUIET, finish, grid, line, styled, triple
from console.reports.content import Picture
from console.reports.flight import Flight
from console.reports.judgement import Judgement
from console.reports.run_log import RunLog
from flight_log.fields import FORCE, RATE, TORQUE_B, TURNING_B
from flight_log.run import Series
from quadrotor.calibration_record import CalibrationRecord
from quadrotor.constants import GRAVITY
from quadrotor.errors import LogFormatError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = npt.NDArray[np.floating]


def gyroscope(log: RunLog, flight: Flight, judged: Judgement) -> list[Picture]:
    """Return the figure of the angular rates during and after the drift estimation."""
    imu = _imu(log)
    rates = np.degrees(imu.rows(RATE))
    found = [one.time for one in log.lines if "gyroscope" in one.text]

    def draw(figure: Figure) -> None:
        axes = grid(figure, 1)[:, 0]
        triple(axes[0], imu.time, rates, linewidth=0.6)
        for time in found:
            axes[0].axvline(time, **DASHED)
        axes[0].plot([], [], **DASHED, label="new drift")
        finish(axes[0], "angular velocity minus the drift in force", "°/s")
        axes[0].set_xlabel("s")

    return [
        Picture(
            "Gyroscope",
            "Residual readings of the gyroscope at rest.",
            "Angular velocity about x, y and z over time.",
            2.6,
            styled(draw),
        )
    ]


def residuals(log: RunLog, flight: Flight, judged: Judgement) -> list[Picture]:
    """Return the accelerometer's figures: specific force over time, and the residual of each
    pose.
    """
    imu = _imu(log)
    force = imu.rows(FORCE)

    def draw(figure: Figure) -> None:
        axes = grid(figure, 2)[:, 0]
        triple(axes[0], imu.time, force, linewidth=0.7)
        finish(axes[0], "specific force with the calibration in use", "m/s²")
        line(
            axes[1],
            imu.time,
            np.linalg.norm(force, axis=1),
            color=COLORS[0],
            linewidth=0.7,
            label="length",
        )
        axes[1].axhline(GRAVITY, **DASHED, label="gravity")
        finish(axes[1], "its magnitude", "m/s²")
        axes[1].set_xlabel("s")

    found = [
        Picture(
            "Accelerometer",
            "Each interval at rest is a pose.",
            "Specific force in x, y and z, and its magnitude next to gravity, over time.",
            3.4,
            styled(draw),
        )
    ]
    return found + residual_pictures(judged.proposal)


def inertia(log: RunLog, flight: Flight, judged: Judgement) -> list[Picture]:
    """Return the figures of the excitation of the three axes and the estimates' convergence."""
    if not log.has("state", "actuators"):
        raise LogFormatError("the log has no topic state or actuators")
    state, actuators = log.topics["state"], log.topics["actuators"]
    rates = np.degrees(state.rows(TURNING_B))
    torque = 1e3 * actuators.rows(TORQUE_B)
    found = read_inertia(log.path, log.vehicle)
    start = found.time[0] - log.start_ns * 1e-9
    time = found.time - found.time[0] + start

    def draw(figure: Figure) -> None:
        axes = grid(figure, 3, height_ratios=(1.0, 1.0, 1.4))[:, 0]
        triple(axes[0], state.time, rates, linewidth=0.8)
        finish(axes[0], "angular velocity", "°/s")
        triple(axes[1], actuators.time, torque, linewidth=0.8)
        finish(axes[1], "commanded torque", "mN m")
        triple(axes[2], time, found.inertia_b, ("xx", "yy", "zz"))
        for k, truth in enumerate(found.truth_b):
            if np.isfinite(truth):
                axes[2].axhline(truth, **{**DASHED, "color": COLORS[k]})
        if np.isfinite(found.truth_b).all():
            axes[2].plot([], [], **DASHED, label="true")
        finish(axes[2], "estimated inertia", "kg m²")
        axes[2].set_xlabel("s")
        axes[2].set_xlim(time[0] - 2.0, time[-1] + 2.0)

    return [
        Picture(
            "Excitation and convergence",
            "Signals that the inertia was estimated from, and the estimates over time.",
            "Angular velocity and commanded torque about x, y and z, and the three estimated "
            "moments of inertia, over time.",
            4.6,
            styled(draw),
        ),
        *residual_pictures(judged.proposal),
    ]


def residual_pictures(record: CalibrationRecord | None) -> list[Picture]:
    """Return a bar chart of a calibration's residuals; nothing without any."""
    if record is None or not record.residuals:
        return []
    names = [re.split(r",\s*", name)[0] for name, _ in record.residuals]
    units = {re.split(r",\s*", name)[-1] for name, _ in record.residuals if "," in name}
    values = np.array([value for _, value in record.residuals])
    unit = units.pop() if len(units) == 1 else ""

    def draw(figure: Figure) -> None:
        axis = grid(figure, 1)[0, 0]
        axis.bar(range(len(values)), values, color=COLORS[0], width=0.7)
        axis.axhline(0.0, color=QUIET, linewidth=0.8)
        few = len(names) <= 24
        axis.set_xticks(
            range(len(names)),
            names if few else [""] * len(names),
            rotation=60 * few,
            ha="right" if few else "center",
            rotation_mode="anchor",
        )
        axis.grid(False, axis="x")
        finish(axis, "residuals", unit, legend=False)

    return [
        Picture(
            "Residuals",
            f"Residual of each {_kind(names)}, from the calibration's own record.",
            f"Bars: {len(values)} residuals in {unit or 'their units'}.",
            2.6,
            styled(draw),
        )
    ]


def _kind(names: list[str]) -> str:
    return "axis" if set(names) <= set(AXES) else "pose, step or axis"


def _imu(log: RunLog) -> Series:
    if not log.has("imu"):
        raise LogFormatError("the log has no topic imu")
    return log.topics["imu"]
