"""The plots of a formation's flight, from the truth in all logs, and its figures as Markdown."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from console.evaluation.bearings_report import figures_as_text
from console.evaluation.result import Result
from console.plots import (
    COLORS,
    DASHED,
    finish,
    grid,
    line,
    require_matplotlib,
    share_window,
    styled,
)
from extensions.formations.mathematics.rigidity import rigidity_eigenvalue
from extensions.formations.options import FormationOptions
from extensions.formations.separation import SEPARATION
from extensions.formations.shape import Shape
from extensions.formations.verdict import (
    RATE,
    STEADY,
    STEERED,
    Windows,
    bearing_errors,
    left_out,
    true_places,
)
from flight_log.run import read_run
from quadrotor.records import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DASHES = "solid", "dashed"
"""Of the first vehicles, and of those whose colour one of these has."""


def write(
    options: FormationOptions,
    shape: Shape,
    windows: Windows,
    logs: Mapping[str, Path],
    results: Mapping[str, Result],
    *,
    joint: Result,
    folder: Path,
) -> list[Path]:
    """Write formation.png and formation.md. Raises UsageError when matplotlib is not installed.

    Args:
        results: of each vehicle. joint: of all together.
    """
    require_matplotlib()
    from matplotlib.figure import Figure

    picture, text = folder / "formation.png", folder / "formation.md"
    times = np.arange(windows.begun, windows.end, 1.0 / RATE)
    places, yaws = true_places({name: read_run(log) for name, log in logs.items()}, times)
    left = left_out(options, results)

    def draw(figure: Figure) -> None:
        _draw(figure, times - windows.begun, list(logs), shape, (places, yaws), left)
        axes = figure.axes
        judged = [(one - windows.begun, two - windows.begun) for one, two in _judged(windows)]
        share_window(np.array([axes[1:]]), judged)
        for (begin, end), limit in zip(judged, (STEADY, STEERED), strict=False):
            axes[1].hlines(limit, begin, end, colors=DASHED["color"], linestyles="dashed")
        axes[3].axhline(options.eigenvalue_min, **DASHED)

    figure = Figure(figsize=(10.0, 6.4), layout="constrained")
    styled(draw)(figure)
    figure.savefig(picture, dpi=120)
    notes = [f"{name}: {one.verdict.replace('_', ' ')}" for name, one in results.items()]
    text.write_text(figures_as_text("Flight of a formation", options, joint, notes, picture.name))
    return [picture, text]


def _judged(windows: Windows) -> list[tuple[float, float]]:
    held = (windows.converged, windows.held), (windows.held, windows.end)
    return [(begin, end) for begin, end in held if end > begin]


def _draw(
    figure: Figure,
    time: Array,
    names: list[str],
    shape: Shape,
    truth: tuple[Array, Array],
    left: set[int],
) -> None:
    """Draw (a) the paths from above, (b) the errors of the bearings, (c) the smallest distance, (d)
    the rigidity eigenvalue of those that are judged.
    """
    places, yaws = truth
    axes = grid(figure, 2, 2, sharex=False).ravel()
    for k, name in enumerate(names):
        color, dashes = COLORS[k % len(COLORS)], DASHES[k // len(COLORS) % len(DASHES)]
        x, y = places[:, k, :2].T
        axes[0].plot(x, y, color=color, linestyle=dashes, linewidth=0.9, label=name)
        axes[0].plot(*places[-1, k, :2], "o", color=color, markersize=5.0)
    axes[0].set_aspect("equal", adjustable="datalim")
    axes[0].set_xlabel("x, m (dots: at the end)")
    finish(axes[0], "(a) paths from above", "y, m", narrow=True)
    errors = bearing_errors(shape, places, yaws, left)
    line(axes[1], time, np.sqrt((errors**2).mean(axis=1)), color=COLORS[0], label="rms")
    line(axes[1], time, errors.max(axis=1), color=COLORS[1], label="largest")
    finish(axes[1], "(b) bearings, to the desired ones", "°", narrow=True)
    i, j = np.triu_indices(len(names), 1)
    apart = np.linalg.norm(places[:, i] - places[:, j], axis=2).min(axis=1)
    line(axes[2], time, apart, color=COLORS[0])
    axes[2].axhline(SEPARATION, **DASHED)
    finish(axes[2], "(c) smallest distance of two vehicles", "m", narrow=True)
    staying = [k for k in range(len(names)) if k not in left]
    edges = [
        (staying.index(one), staying.index(two))
        for one, two in shape.desired
        if not left.intersection((one, two))
    ]
    rigid = [
        rigidity_eigenvalue(place[staying], yaw[staying], edges)
        for place, yaw in zip(places, yaws, strict=True)
    ]
    line(axes[3], time, np.array(rigid), color=COLORS[0])
    finish(axes[3], "(d) rigidity eigenvalue of all bearings", "", narrow=True)
