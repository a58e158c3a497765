"""Figures of a campaign: distributions, effects, pairs, parallel coordinates, the Pareto front."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from console.plots import COLORS, QUIET, finish, grid, styled
from console.reports.content import Picture
from extensions.campaigns.analysis.effects import chosen_flights, main_effect, numeric
from extensions.campaigns.design import Cells
from extensions.campaigns.distributions import ecdf, heat_map
from extensions.campaigns.search.told import SearchOutcome
from extensions.campaigns.table import numbers

if TYPE_CHECKING:
    import pyarrow as pa
    from matplotlib.figure import Figure

MOST_POINTS = 1000
"""Flights in a scatter matrix or in parallel coordinates at most: evenly chosen ones."""
MOST_AXES = 5
"""Columns of a scatter matrix at most."""


def pictures(
    cells: Cells, table: pa.Table, metrics: Sequence[str], search: SearchOutcome | None
) -> list[Picture]:
    """Return the figures that these metrics have, the first of them being the main one."""
    if not metrics:
        return []
    main, factors = metrics[0], numeric(table, cells.plan.varied)
    found = [_distributions(table, metrics)]
    if search is not None and search.best:
        found.append(_course(search) if len(search.search.aims) == 1 else _front(search))
    elif len(cells.plan.varied) > 0:
        found.append(_effects(cells, table, main, cells.plan.varied[:6]))
    if len(cells.plan.varied) > 1 and search is None:
        found.append(_map(cells, table, main, *cells.plan.varied[:2]))
    if factors:
        names = [*factors[: MOST_AXES - 1], main]
        found.append(_scatter(table, names))
    if len(factors) > 1:
        found.append(_parallel(table, [*factors, *metrics[:2]], main))
    return found


def _distributions(table: pa.Table, metrics: Sequence[str]) -> Picture:
    def draw(figure: Figure) -> None:
        axes = grid(figure, 1, len(metrics), sharex=False)[0]
        for axis, metric in zip(axes, metrics, strict=True):
            curve = ecdf(numbers(table, metric))
            axis.step(curve["values"], curve["shares"], where="post", color=COLORS[0])
            if curve["values"]:
                axis.axvspan(*curve["interval"], color="#d5e5f0", linewidth=0)
                axis.axvline(curve["median"], color=QUIET, linewidth=0.8, linestyle="--")
            finish(axis, metric, "share of the flights", legend=False)

    return Picture(
        "Distributions",
        "Share of the flights below each value; dashed the median, shaded its 95 % interval.",
        "Empirical distribution functions of metrics.",
        2.4,
        styled(draw),
    )


def _effects(cells: Cells, table: pa.Table, metric: str, factors: Sequence[str]) -> Picture:
    rows = -(-len(factors) // 3)

    def draw(figure: Figure) -> None:
        axes = grid(figure, rows, min(3, len(factors)), sharex=False, sharey=True)
        for axis in axes.flat[len(factors) :]:
            axis.set_visible(False)
        every: list[Any] = list(axes.flat)
        for axis, factor in zip(every, factors, strict=False):
            found = main_effect(cells, table, metric, factor)["levels"]
            middle = [one["median"] for one in found]
            ends = [
                [one["median"] - one["low"] for one in found],
                [one["high"] - one["median"] for one in found],
            ]
            places = range(len(found))
            axis.errorbar(places, middle, ends, color=COLORS[0], marker="o", markersize=3)
            step = max(1, len(found) // 4)
            axis.set_xticks(list(places)[::step], [one["level"] for one in found][::step])
            axis.set_xlabel(factor)
            finish(axis, "", metric if axis in axes[:, 0] else "", legend=False)

    return Picture(
        "Main effects",
        f"Median of {metric} at each level of a factor, over all others, with its 95 % interval.",
        "A plot of medians for each factor.",
        2.4 * rows,
        styled(draw),
    )


def _map(cells: Cells, table: pa.Table, metric: str, x: str, y: str) -> Picture:
    found = heat_map(cells, table, metric, x, y)

    def draw(figure: Figure) -> None:
        axis = figure.subplots()
        values = np.array(found["medians"], float)
        image = axis.imshow(values, origin="lower", aspect="auto", cmap="cividis")
        for labels, place in ((found["x"], axis.set_xticks), (found["y"], axis.set_yticks)):
            step = max(1, len(labels) // 8)
            place(range(0, len(labels), step), labels[::step])
        axis.grid(visible=False)
        axis.set_xlabel(x)
        axis.set_ylabel(y)
        figure.colorbar(image, ax=axis, label=f"median {metric}")

    return Picture(
        "Medians over two factors",
        f"Median of {metric}; empty where no flight has it.",
        "A map of medians over two factors.",
        3.2,
        styled(draw),
    )


def _scatter(table: pa.Table, names: Sequence[str]) -> Picture:
    (_, values), n = chosen_flights(table, names, MOST_POINTS), len(names)

    def draw(figure: Figure) -> None:
        axes = grid(figure, n, n, sharex="col")
        for row in range(n):
            for k in range(n):
                axis = axes[row, k]
                if row == k:
                    axis.hist(values[:, k], bins=20, color=COLORS[0])
                    axis.set_yticks([])
                else:
                    axis.plot(values[:, k], values[:, row], ".", markersize=1.5, color=COLORS[0])
                    if k:
                        axis.tick_params(labelleft=False)
                if k == 0:
                    axis.set_ylabel(names[row].rpartition(".")[2])
                if row == n - 1:
                    axis.set_xlabel(names[k].rpartition(".")[2])

    return Picture(
        "Scatter matrix",
        f"{len(values)} flights; on the diagonal how often each value occurs. "
        f"Of {', '.join(names)}.",
        "Scatter plots of each pair of columns.",
        1.5 * n,
        styled(draw),
    )


def _parallel(table: pa.Table, names: Sequence[str], metric: str) -> Picture:
    _, values = chosen_flights(table, names, MOST_POINTS)

    def draw(figure: Figure) -> None:
        from matplotlib import colormaps
        from matplotlib.collections import LineCollection

        axis = figure.subplots()
        low, high = values.min(axis=0), values.max(axis=0)
        unit = (values - low) / np.where(high > low, high - low, 1.0)
        worse = unit[:, names.index(metric)]
        lines: Any = np.stack([np.tile(np.arange(len(names)), (len(unit), 1)), unit], axis=2)
        colors = colormaps["viridis_r"](worse)
        axis.add_collection(LineCollection(lines, colors=colors, linewidths=0.5, alpha=0.6))
        axis.set_xlim(-0.05, len(names) - 0.95)
        axis.set_ylim(-0.05, 1.05)
        axis.set_yticks([])
        labels = [
            f"{name.rpartition('.')[2]}\n{a:.3g} … {b:.3g}"
            for name, a, b in zip(names, low, high, strict=True)
        ]
        axis.set_xticks(range(len(names)), labels)

    return Picture(
        "Parallel coordinates",
        f"Each line is a flight, from the least to the largest value of each column; dark: a large "
        f"{metric}.",
        "Lines through the values of each flight.",
        3.0,
        styled(draw),
    )


def _course(found: SearchOutcome) -> Picture:
    whole = [one for one in found.trials if one.values]

    def draw(figure: Figure) -> None:
        axis = figure.subplots()
        numbers_, values = [one.number for one in whole], [one.values[0] for one in whole]
        axis.plot(numbers_, values, ".", color=QUIET, label="trial")
        best = np.minimum.accumulate(values)
        axis.step(numbers_, best, where="post", color=COLORS[0], label="best so far")
        axis.set_yscale("log")
        axis.set_xlabel("trial")
        finish(axis, "", f"{found.search.aggregate} {found.search.aims[0]}")

    return Picture(
        "Course of the search",
        "Trials that are whole and feasible, and the best of them so far.",
        "The aim over the number of the trial.",
        2.6,
        styled(draw),
    )


def _front(found: SearchOutcome) -> Picture:
    whole = [one for one in found.trials if one.values]
    aims = found.search.aims[:2]

    def draw(figure: Figure) -> None:
        axis = figure.subplots()
        values = np.array([one.values[:2] for one in whole])
        axis.plot(*values.T, ".", color=QUIET, label="feasible trial")
        best = np.array(sorted(found.of(number).values[:2] for number in found.best))
        axis.plot(*best.T, "o-", markersize=4, color=COLORS[1], label="Pareto front")
        axis.set_xlabel(f"{found.search.aggregate} {aims[0]}")
        finish(axis, "", f"{found.search.aggregate} {aims[1]}")

    return Picture(
        "Pareto front",
        "Feasible trials; no other one is better in all aims than those on the front.",
        "Two aims of each trial.",
        3.2,
        styled(draw),
    )
