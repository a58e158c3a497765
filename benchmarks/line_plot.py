"""Several curves in one picture, two panels per row."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

COLOURS = ("#1f6f8b", "#d9822b", "#5a8f3c", "#8b4f8f")


def draw_lines(panels: list[dict[str, Any]], path: Path) -> None:
    """Write a PNG. Raises ImportError without matplotlib.

    Args:
        panels: each has x_label, y_label, lines (label, x, y), and optionally limit (a horizontal
            line) with limit_label, log_x, ticks (of x), reverse_x.
    """
    from matplotlib import pyplot

    columns = min(2, len(panels))
    rows = math.ceil(len(panels) / columns)
    figure, grid = pyplot.subplots(
        rows,
        columns,
        figsize=(4.6 * columns + 0.4 * (columns == 1), 3.3 * rows),
        layout="constrained",
        squeeze=False,
    )
    for axes, panel in zip(grid.flat, panels, strict=False):
        for colour, line in zip(COLOURS, panel["lines"], strict=False):
            mark = "o-" if len(line["x"]) < 20 else "-"
            axes.plot(
                line["x"],
                line["y"],
                mark,
                color=colour,
                label=line["label"],
                linewidth=1.2,
                markersize=4,
            )
        if "limit" in panel:
            axes.axhline(
                panel["limit"],
                color="#b3402e",
                linestyle="--",
                linewidth=1.0,
                label=panel.get("limit_label", "limit"),
            )
        if panel.get("log_x"):
            axes.set_xscale("log")
        if "ticks" in panel:
            axes.set_xticks(panel["ticks"], [f"{tick:g}" for tick in panel["ticks"]])
            axes.minorticks_off()
        if panel.get("reverse_x"):
            axes.invert_xaxis()
        axes.set_xlabel(panel["x_label"])
        axes.set_ylabel(panel["y_label"])
        axes.grid(True, alpha=0.3)
        axes.legend(frameon=False, fontsize=8)
    for axes in list(grid.flat)[len(panels) :]:
        axes.set_visible(False)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
