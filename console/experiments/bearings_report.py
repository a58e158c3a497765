"""The four plots of Fig. 6 of one flight, and its figures as Markdown."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from console.experiments.bearings_log import BearingsFlight
from console.experiments.client import Result
from quadrotor.errors import UsageError
from quadrotor.parameters import Parameters

Array = npt.NDArray[np.float64]

COLORS = ("#b3402e", "#3d7a3d", "#1f6f8b")


def write(flight: BearingsFlight, options: Parameters, result: Result, stem: Path) -> list[Path]:
    """STEM.png and STEM.md. Raises UsageError when matplotlib is not installed."""
    try:
        import matplotlib
    except ImportError:
        raise UsageError(
            "the plots of --report need matplotlib, which is not installed: pip install matplotlib"
        ) from None
    matplotlib.use("Agg")
    from matplotlib import pyplot

    picture, text = stem.with_suffix(".png"), stem.with_suffix(".md")
    figure, axes = pyplot.subplots(2, 2, figsize=(11.0, 7.0), layout="constrained", sharex=True)
    time = flight.time - flight.time[0]
    truth, estimate = flight.truth, flight.estimate
    angles, angles_estimated = (np.degrees(roll_pitch_yaw(x[:, 6:])) for x in (truth, estimate))
    _pairs(axes[0, 0], time, truth[:, :3], estimate[:, :3], "xyz")
    _pairs(axes[0, 1], time, angles, angles_estimated, ("roll", "pitch", "yaw"))
    _lines(axes[1, 0], time, 1e3 * (truth - estimate)[:, :3], "xyz")
    _lines(axes[1, 1], time, np.degrees(flight.turns), ("about x", "about y", "about z"))
    titles = ("(a) position, m", "(b) orientation, deg", "(c) position error, mm",
              "(d) orientation error, deg")  # fmt: skip
    for axis, title in zip(axes.flat, titles, strict=True):
        axis.set_title(title, loc="left", fontsize=10)
        axis.grid(True, alpha=0.3)
        axis.legend(
            frameon=False, fontsize=8, ncols=4, loc="lower right", bbox_to_anchor=(1.0, 0.99)
        )
        for edge in flight.window:
            axis.axvline(edge - flight.time[0], color="0.6", linewidth=0.8, linestyle=":")
    for axis in axes[1]:
        axis.set_xlabel("s on bearings (dotted: what is judged)")
    figure.savefig(picture, dpi=120)
    pyplot.close(figure)
    text.write_text(_markdown(options, result, flight, picture.name))
    return [picture, text]


def roll_pitch_yaw(q: Array) -> Array:
    """(N, 3) rad of quaternions (N, 4); yaw without jumps."""
    w, x, y, z = q.T
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
    yaw = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    return np.stack([roll, pitch, yaw], axis=1)


def _pairs(axis: Any, time: Array, truth: Array, estimate: Array, names: Any) -> None:
    for k, name in enumerate(names):
        axis.plot(time, truth[:, k], color=COLORS[k], linewidth=1.2, label=name)
        axis.plot(time, estimate[:, k], color="black", linewidth=0.7, linestyle="--")
    axis.plot([], [], color="black", linewidth=0.7, linestyle="--", label="estimated")


def _lines(axis: Any, time: Array, values: Array, names: Any) -> None:
    for k, name in enumerate(names):
        axis.plot(time, values[:, k], color=COLORS[k], linewidth=0.8, label=name)


def _markdown(options: Parameters, result: Result, flight: BearingsFlight, picture: str) -> str:
    lines = ["# Flight on bearings", "", f"Verdict: **{result.verdict}**", ""]
    lines += [f"- `experiment.{name}` = {value}" for name, value in options]
    lines += [f"- {text}" for text in flight.fell_back]
    lines += ["", "| figure | value | at most |", "|---|---:|---:|"]
    for name, value in result.metrics.items():
        limit = result.limits.get(name)
        lines.append(f"| {name} | {value:.5g} | {'' if limit is None else f'{limit:g}'} |")
    lines += ["", f"![truth and estimate, and their difference]({picture})", ""]
    return "\n".join(lines)
