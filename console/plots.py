"""The style of all plots in reports: colours for colour-blind readers, plain axes, thinned lines.

matplotlib is imported only where a figure is created.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from quadrotor.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = npt.NDArray[np.floating]
Grid = npt.NDArray[np.object_]  # of axes
Spans = Sequence[tuple[float, float]]

# By Okabe and Ito, dark enough for thin lines on white.
COLORS = ("#0072b2", "#d55e00", "#009e73", "#a3528b")
REFERENCE = "#333333"
QUIET = "#8c8c8c"
DASHED: Any = {"color": REFERENCE, "linewidth": 0.8, "linestyle": (0, (4, 2))}
"""Style of lines for comparison: true values, limits, the estimate next to the truth."""
GOOD = "#009e73"
AXES = ("x", "y", "z")
ANGLES = ("roll", "pitch", "yaw")
POINTS = 1600
"""Maximum number of points of a line: the lowest and the highest value of each bucket."""
STYLE: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "sans-serif"],
    "font.size": 8.5,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.labelsize": 8.5,
    "axes.edgecolor": "#777777",
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.2,
    "lines.linewidth": 1.1,
    "svg.fonttype": "none",
    "svg.hashsalt": "quadlab",
    "pdf.fonttype": 42,
}


def require_matplotlib(asked: str = "a report") -> None:
    """Raise UsageError when matplotlib, which `asked` needs, is not installed."""
    try:
        import matplotlib
    except ImportError:
        raise UsageError(
            f"{asked} needs matplotlib, which is not installed: pip install matplotlib"
        ) from None
    matplotlib.use("Agg")


def thinned(time: Array, values: Array, points: int = POINTS) -> tuple[Array, Array]:
    """Return a line (N,) thinned to about `points` points, keeping every peak and every gap."""
    count = len(time)
    if count <= points:
        return time, values
    size = -(-count // (points // 2))
    edges = np.arange(0, count, size)
    hidden = ~np.isfinite(values)
    low = np.where(hidden, np.inf, values)
    high = np.where(hidden, -np.inf, values)
    padding = -count % size
    low = np.pad(low, (0, padding), constant_values=np.inf).reshape(len(edges), size)
    high = np.pad(high, (0, padding), constant_values=-np.inf).reshape(len(edges), size)
    first, second = low.argmin(axis=1) + edges, high.argmax(axis=1) + edges
    chosen = np.stack([np.minimum(first, second), np.maximum(first, second)], axis=1).ravel()
    # In a bucket with a gap, one of its points is replaced by the gap.
    holes = np.add.reduceat(hidden, edges) > 0
    nowhere = np.array(
        [
            edges[k] + int(hidden[edges[k] : edges[k] + size].argmax())
            for k in np.flatnonzero(holes)
        ],
        dtype=np.int64,
    )
    chosen = np.union1d(chosen, nowhere)
    return time[chosen], values[chosen]


def line(axis: Axes, time: Array, values: npt.NDArray[np.floating], **style: Any) -> None:
    """Draw a thinned line, interrupted at long gaps in the data."""
    axis.plot(*thinned(*broken(time, np.asarray(values, np.float64))), **style)


def broken(time: Array, values: Array) -> tuple[Array, Array]:
    """Return time and values with a NaN in each gap longer than eight usual periods and
    0.1 s.
    """
    if len(time) < 3:
        return time, values
    steps = np.diff(time)
    holes = np.flatnonzero(steps > max(0.1, 8.0 * float(np.median(steps)))) + 1
    if not len(holes):
        return time, values
    return np.insert(time, holes, time[holes - 1]), np.insert(values, holes, np.nan)


def triple(
    axis: Axes, time: Array, values: Array, names: Sequence[str] = AXES, **style: Any
) -> None:
    """Draw the columns of (N, 3) as lines of three colours."""
    for k, name in enumerate(names):
        line(axis, time, values[:, k], color=COLORS[k], label=name, **style)


def dashed(axis: Axes, time: Array, values: Array, label: str) -> None:
    """Draw the columns of the comparison, dark and dashed, with one entry in the legend."""
    for k in range(values.shape[1]):
        line(axis, time, values[:, k], **DASHED)
    axis.plot([], [], **DASHED, label=label)


def band(axis: Axes, time: Array, values: Array, label: str) -> None:
    """Draw the columns of the reference as broad pale lines behind the others."""
    style: Any = {"color": "#bdbdbd", "linewidth": 3.2, "solid_capstyle": "butt", "zorder": 1.5}
    for k in range(values.shape[1]):
        line(axis, time, values[:, k], **style)
    axis.plot([], [], **style, label=label)


def finish(axis: Axes, title: str, unit: str, *, legend: bool = True, narrow: bool = False) -> None:
    """Place the title on the left and the legend on the right, or below the title for narrow
    axes.
    """
    axis.set_title(title, pad=17.0 if narrow else None)
    axis.set_ylabel(unit)
    if legend and axis.get_legend_handles_labels()[0]:
        place: Any = ("lower left", (-0.012, 1.0)) if narrow else ("lower right", (1.0, 1.0))
        axis.legend(
            loc=place[0], bbox_to_anchor=place[1], ncols=5, borderaxespad=0.1, borderpad=0.2
        )


def window(axis: Axes, spans: Spans) -> None:
    """Shade the judged intervals."""
    for start, end in spans:
        axis.axvspan(start, end, color="#eef3f7", linewidth=0, zorder=0)


def grid(figure: Figure, rows: int, columns: int = 1, **more: Any) -> Grid:
    """Return axes of shape (rows, columns) that share the time axis."""
    axes: Grid = figure.subplots(rows, columns, squeeze=False, **{"sharex": True, **more})
    return axes


def styled(draw: Callable[[Figure], None]) -> Callable[[Figure], None]:
    """Wrap a drawing function so that it draws in the report's style."""

    def inside(figure: Figure) -> None:
        import matplotlib

        with matplotlib.rc_context(STYLE):
            draw(figure)
            for one in (figure, *figure.subfigs):
                one.align_ylabels()

    return inside


def state_estimation(
    figure: Figure,
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
    finish(axes[0, 1], "(b) orientation", "°", narrow=True)
    triple(axes[1, 0], time, 1e3 * position_error)
    finish(axes[1, 0], f"(c) position error to {truth}", "mm", narrow=True)
    triple(axes[1, 1], time, np.degrees(turn))
    finish(axes[1, 1], "(d) orientation error, about", "°", narrow=True)
    share_window(axes, judged)


def share_window(axes: Any, judged: Spans) -> None:
    """Shade the judged intervals in all axes, and label their common times."""
    for axis in axes.flat:
        window(axis, judged)
    for axis in axes[-1]:
        axis.set_xlabel("s (shaded: judged)" if judged else "s")
