"""Figs. 2, 3, 4 and 6 of the paper, with the sub-plots of their captions.

Each function fills an empty figure. Times are in s, positions in m, angles in rad; unknown values
are NaN.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from console.reports.plots import (
    ANGLES,
    COLORS,
    DASHED,
    GOOD,
    REFERENCE,
    band,
    dashed,
    finish,
    grid,
    line,
    triple,
    window,
)

Array = npt.NDArray[np.floating[Any]]
Spans = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Bench:
    """Signals of a motor bench test, and the results of its steps.

    Attributes:
        reference: (N,) counts at `time`.
        force, torque: (M,) N and N m at `sensor_time`.
        step_reference, step_force: (K,) counts and N of the steps.
        used: which steps are part of the fit.
        fits: name → (force, reference) of a curve.
    """

    time: Array
    reference: Array
    sensor_time: Array
    force: Array
    torque: Array
    step_reference: Array
    step_force: Array
    used: npt.NDArray[np.bool_]
    fits: Mapping[str, tuple[Array, Array]]


def motor_calibration(figure: Any, bench: Bench) -> None:
    """Draw Fig. 2: (a) input and output signals, (b) the fitted model as a function of force."""
    left, right = figure.subfigures(1, 2, width_ratios=(1.25, 1.0))
    axes = grid(left, 3)[:, 0]
    line(axes[0], bench.time, bench.reference, color=GOOD, label="reference")
    finish(axes[0], "(a) reference", "counts", legend=False)
    line(axes[1], bench.sensor_time, bench.force, color=COLORS[0])
    finish(axes[1], "force", "N", legend=False)
    line(axes[2], bench.sensor_time, 1e3 * bench.torque, color=COLORS[1])
    finish(axes[2], "torque", "mN m", legend=False)
    axes[2].set_xlabel("s")
    axis = grid(right, 1)[0, 0]
    axis.plot(
        bench.step_force[bench.used],
        bench.step_reference[bench.used],
        "o",
        color=COLORS[0],
        markersize=4,
        label="measured",
    )
    if not bench.used.all():
        axis.plot(
            bench.step_force[~bench.used],
            bench.step_reference[~bench.used],
            "o",
            markersize=4,
            markerfacecolor="white",
            markeredgecolor=COLORS[0],
            label="left out",
        )
    styles = ((REFERENCE, "-"), (COLORS[1], (0, (4, 2))))
    for (name, (force, reference)), (color, style) in zip(bench.fits.items(), styles, strict=False):
        axis.plot(force, reference, color=color, linestyle=style, label=name)
    axis.set_xlabel("force, N")
    finish(axis, "(b) fitted model", "reference, counts", legend=False)
    axis.legend(loc="lower right")


def mass_estimation(
    figure: Any,
    mass: tuple[Array, Array, Array],
    position: tuple[Array, Array],
    velocity: tuple[Array, Array],
    true_mass: float | None,
    flown: Spans,
) -> None:
    """Draw Fig. 3: (a) estimated mass, (b) position, (c) velocity.

    Args:
        mass: time, kg, and its standard deviation.
        position, velocity: time and (N, 3).
        true_mass: kg, NaN or None when unknown.
    """
    axes = grid(figure, 3)[:, 0]
    time, value, deviation = mass
    known = np.isfinite(deviation) & (deviation < 0.3)
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
    if true_mass is not None and np.isfinite(true_mass):
        axes[0].axhline(true_mass, **DASHED, label=f"true {true_mass:.4g} kg")
    finish(axes[0], "(a) mass", "kg")
    triple(axes[1], *position)
    finish(axes[1], "(b) position", "m")
    triple(axes[2], *velocity)
    finish(axes[2], "(c) velocity", "m/s")
    for axis in axes:
        window(axis, flown)
    axes[2].set_xlabel("s (shaded: airborne)")


def trajectory_tracking(
    figure: Any,
    time: Array,
    position: Array,
    wanted: Array,
    yaw: Array,
    yaw_wanted: Array,
    position_error: Array,
    yaw_error: Array,
    judged: Spans,
) -> None:
    """Draw Fig. 4: (a) position, (b) yaw, (c) position error, (d) yaw error."""
    axes = grid(figure, 2, 2)
    triple(axes[0, 0], time, position)
    band(axes[0, 0], time, wanted, "reference")
    finish(axes[0, 0], "(a) position", "m", narrow=True)
    line(axes[0, 1], time, np.degrees(yaw), color=COLORS[0], label="yaw")
    band(axes[0, 1], time, np.degrees(yaw_wanted)[:, None], "reference")
    finish(axes[0, 1], "(b) yaw", "deg", narrow=True)
    triple(axes[1, 0], time, 1e3 * position_error)
    finish(axes[1, 0], "(c) position error", "mm", narrow=True)
    line(axes[1, 1], time, np.degrees(yaw_error), color=COLORS[0])
    finish(axes[1, 1], "(d) yaw error", "deg", legend=False, narrow=True)
    _share_window(axes, judged)


def state_estimation(
    figure: Any,
    time: Array,
    position: tuple[Array, Array],
    angles: tuple[Array, Array],
    position_error: Array,
    turn: Array,
    judged: Spans,
    truth: str = "truth",
) -> None:
    """Draw Fig. 6: (a) position, (b) roll, pitch, yaw, (c) position error, (d) orientation error.

    Args:
        position, angles: true and estimated, (N, 3) each.
        turn: (N, 3) rad, rotation vector from the estimated attitude to the true one.
        truth: name of the source that counts as true.
    """
    axes = grid(figure, 2, 2)
    triple(axes[0, 0], time, position[0])
    dashed(axes[0, 0], time, position[1], "estimated")
    finish(axes[0, 0], "(a) position", "m", narrow=True)
    triple(axes[0, 1], time, np.degrees(angles[0]), ANGLES)
    dashed(axes[0, 1], time, np.degrees(angles[1]), "estimated")
    finish(axes[0, 1], "(b) orientation", "deg", narrow=True)
    triple(axes[1, 0], time, 1e3 * position_error)
    finish(axes[1, 0], f"(c) position error to {truth}", "mm", narrow=True)
    triple(axes[1, 1], time, np.degrees(turn))
    finish(axes[1, 1], "(d) orientation error, about", "deg", narrow=True)
    _share_window(axes, judged)


def _share_window(axes: Any, judged: Spans) -> None:
    for axis in axes.flat:
        window(axis, judged)
    for axis in axes[-1]:
        axis.set_xlabel("s (shaded: judged)" if judged else "s")
