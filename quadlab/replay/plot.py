"""A plot of the position errors of all runs over time."""

from __future__ import annotations

from pathlib import Path

from quadlab.replay.log import Recording
from quadlab.replay.report import RECORDED, Row
from quadlab.replay.window import Window
from quadrotor.errors import StorageError, UsageError

# Okabe and Ito's colours, which colour-blind people can distinguish too.
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
STYLES = ("-", "-.", ":")
SPREAD = 10.0
"""Ratio of the largest to the smallest rms above which the axis is logarithmic."""


def check_plot(path: Path) -> None:
    """Check the plot's file before the replay begins. Raises UsageError."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise UsageError(
            "--plot needs matplotlib, which is not installed: pip install matplotlib"
        ) from None
    from matplotlib.backend_bases import FigureCanvasBase

    ending = path.suffix.lstrip(".").lower()
    if ending not in FigureCanvasBase.filetypes:
        raise UsageError(f"--plot {path}: no picture ends in {path.suffix!r}; try .png, .svg, .pdf")


def draw(path: Path, recording: Recording, window: Window, rows: list[Row]) -> None:
    """Draw errors as solid lines, three standard deviations stated by the estimator as dashed ones.
    Raises StorageError.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(10.0, 6.0), layout="constrained")
    replays = [row for row in rows if row.label != RECORDED]
    for row in rows:
        time, error = recording.seconds(row.errors.stamps_ns), 1e3 * row.errors.position
        if row.label == RECORDED:
            axes.plot(time, error, color="#999999", linewidth=1.0, label=f"{RECORDED}{_rms(row)}")
            continue
        k = next(k for k, one in enumerate(replays) if one is row)
        color, style = COLORS[k % len(COLORS)], STYLES[k // len(COLORS) % len(STYLES)]
        label = f"{row.label}, {row.measurements}{_rms(row)}"
        axes.plot(time, error, style, color=color, linewidth=1.0, label=label)
        inside = (row.deviation_ns >= window.start_ns) & (row.deviation_ns <= window.end_ns)
        if inside.any():
            time, bound = recording.seconds(row.deviation_ns[inside]), 3e3 * row.deviation[inside]
            axes.step(time, bound, "--", where="post", color=color, linewidth=1.2, alpha=0.7)
    if any(len(row.deviation) for row in replays):
        axes.plot([], [], "--", color="#666666", label="3σ by the estimator's own covariance")
    sizes = [1e3 * float(rms) for row in rows if (rms := row.values["position_rms_m"])]
    if sizes and max(sizes) > SPREAD * min(sizes):
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.1 * min(sizes))
    else:
        axes.set_ylim(bottom=0.0)
    axes.set_xlim(recording.seconds(window.start_ns), recording.seconds(window.end_ns))
    axes.set_xlabel("time (s)")
    axes.set_ylabel("position error (mm)")
    axes.set_title(recording.path.name, fontsize=10)
    axes.grid(True, alpha=0.3)
    figure.legend(frameon=False, fontsize=8, loc="outside lower center")
    try:
        figure.savefig(path, dpi=120)
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}") from error
    finally:
        pyplot.close(figure)


def _rms(row: Row) -> str:
    rms = row.values["position_rms_m"]
    return ", no estimate" if rms is None else f", {1e3 * float(rms):.1f} mm rms"
