"""Figures of any flight: position and reference, attitude, motors, battery, mass."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from console.plots import ANGLES, COLORS, QUIET, band, finish, grid, line, styled, triple, window
from console.reports.content import Picture
from console.reports.flight import Flight, airborne
from console.reports.run_log import RunLog
from flight_log.fields import MOTOR_REFERENCES
from quadrotor.constants import MOTORS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = npt.NDArray[np.floating]


def flight_pictures(log: RunLog, flight: Flight, *, standing: bool = False) -> list[Picture]:
    """Return the figures for which the log has data.

    Args:
        standing: whether the vehicle was not meant to fly; position and attitude are then
            omitted.
    """
    found = []
    if flight.shown is not None and not standing:
        found.append(_position(log, flight))
        found.append(_attitude(log, flight))
    if log.has("actuators"):
        found.append(_motors(log))
    wanted = ("battery", "status") if standing else ("estimator", "battery", "status")
    rows = [name for name in wanted if _shown(log, name)]
    if rows:
        found.append(_health(log, rows))
    return found


def _position(log: RunLog, flight: Flight) -> Picture:
    shown = flight.shown
    assert shown is not None
    error, _ = flight.tracking_error
    wanted = flight.reference[:, :3]

    def draw(figure: Figure) -> None:
        axes = grid(figure, 3)[:, 0]
        triple(axes[0], shown.time, shown.position_w)
        band(axes[0], shown.time, wanted, "reference")
        finish(axes[0], f"position ({shown.name})", "m")
        triple(axes[1], shown.time, 1e3 * error)
        finish(axes[1], "position minus reference", "mm")
        triple(axes[2], shown.time, shown.velocity_w)
        finish(axes[2], "velocity", "m/s")
        _times(axes, log)

    return Picture(
        "Position",
        "Position and reference of the vehicle, the difference, and its velocity.",
        "Three plots over time: position with its reference, position error, velocity; x, y and z.",
        4.4,
        styled(draw),
    )


def _attitude(log: RunLog, flight: Flight) -> Picture:
    shown = flight.shown
    assert shown is not None
    _, yaw_error = flight.tracking_error
    position, _, angles = flight.estimation_error

    def draw(figure: Figure) -> None:
        truth = flight.truth
        rows = 2 if truth is None or not len(position) else 4
        axes = grid(figure, rows)[:, 0]
        triple(axes[0], shown.time, np.degrees(shown.angles), ANGLES)
        wanted = flight.reference[:, 3:]
        band(axes[0], shown.time, np.degrees(np.unwrap(wanted, axis=0)), "yaw reference")
        finish(axes[0], f"attitude ({shown.name})", "°")
        line(axes[1], shown.time, np.degrees(yaw_error), color=COLORS[2])
        finish(axes[1], "yaw minus reference", "°", legend=False)
        if rows == 4 and truth is not None:
            triple(axes[2], truth.time, 1e3 * position)
            finish(axes[2], f"estimate: position error to {truth.name}", "mm")
            triple(axes[3], truth.time, np.degrees(angles), ANGLES)
            finish(axes[3], f"estimate: attitude error to {truth.name}", "°")
        _times(axes, log)

    more = " The estimate's errors are truth minus estimate." if len(position) else ""
    return Picture(
        "Attitude and estimate",
        f"Roll, pitch and yaw, and the yaw error.{more}",
        "Plots over time of roll, pitch and yaw, of the yaw error, and of the estimate's errors.",
        4.8 if len(position) else 3.2,
        styled(draw),
    )


def _motors(log: RunLog) -> Picture:
    series = log.topics["actuators"]

    def draw(figure: Figure) -> None:
        axes = grid(figure, 2, height_ratios=(2.0, 1.0))[:, 0]
        for k, name in enumerate(MOTORS):
            if MOTOR_REFERENCES[k] in series:
                column = series.values(MOTOR_REFERENCES[k])
                line(axes[0], series.time, column, color=COLORS[k], label=name, linewidth=0.8)
        finish(axes[0], "motor references", "counts")
        scaling = series.rows(("scaling",))[:, 0]
        line(axes[1], series.time, scaling, color=COLORS[0])
        axes[1].set_ylim(-0.05, 1.1)
        finish(axes[1], "scaling of the wrench (1: not scaled)", "")
        _times(axes, log)

    return Picture(
        "Motors",
        "References of the motors, and whether the wrench was scaled down.",
        "Two plots over time: references of the four motors, and the scaling of the wrench.",
        3.2,
        styled(draw),
    )


def _health(log: RunLog, rows: list[str]) -> Picture:
    def draw(figure: Figure) -> None:
        axes = grid(figure, len(rows))[:, 0]
        for axis, name in zip(axes, rows, strict=True):
            series = log.topics[name]
            if name == "estimator":
                mass, variance = series.rows(("mass", "mass_variance")).T
                deviation = np.sqrt(np.maximum(variance, 0.0))
                line(axis, series.time, mass, color=COLORS[0], label="estimated")
                low, high = mass - deviation, mass + deviation
                known = deviation < 0.05
                for edge, label in ((low, "± its standard deviation"), (high, "")):
                    at = np.where(known, edge, np.nan)
                    line(axis, series.time, at, color=QUIET, linewidth=0.7, label=label or None)
                finish(axis, "mass", "kg")
            elif name == "battery":
                line(axis, series.time, series.rows(("voltage",))[:, 0], color=COLORS[0])
                finish(axis, "battery", "V", legend=False)
            else:
                late = series.rows(("lateness_p99", "lateness_max")).T
                line(axis, series.time, 1e3 * late[1], color=COLORS[1], label="longest")
                line(axis, series.time, 1e3 * late[0], color=COLORS[0], label="99 %")
                finish(axis, "lateness of the ticks", "ms")
        _times(axes, log)

    words = {"estimator": "estimated mass", "battery": "battery", "status": "lateness of the loop"}
    content = ", ".join(words[name] for name in rows)
    return Picture(
        content[0].upper() + content[1:],
        "Over the whole run.",
        f"Plots over time: {content}.",
        0.5 + 1.15 * len(rows),
        styled(draw),
    )


HEALTH = {
    "battery": ("voltage",),
    "estimator": ("mass", "mass_variance", "measurement_age", "consistency", "refused_share"),
}
"""Numbers by topic that have values where there is something to show."""


def _shown(log: RunLog, topic: str) -> bool:
    """Return whether the figure has finite values to show."""
    if not log.has(topic):
        return False
    series = log.topics[topic]
    if topic == "status":
        return bool(np.nanmax(series.rows(("lateness_max",)), initial=0.0) > 0.0)
    shown = [name for name in HEALTH[topic] if name in series]
    return any(np.isfinite(series.values(name)).any() for name in shown)


def _times(axes: Any, log: RunLog) -> None:
    spans = airborne(log)
    for axis in axes:
        window(axis, spans)
    axes[-1].set_xlabel("s (shaded: airborne)" if spans else "s")
    axes[-1].set_xlim(0.0, max(log.duration, 1e-3))
