"""The residual of each direction over time, what its term explains of it, and what is left."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from console.plots import COLORS, DASHED, finish, grid, line, require_matplotlib, styled
from extensions.identification.residual.fit import ResidualFit, directions
from extensions.identification.residual.flights import FlightResidual
from quadrotor.errors import UsageError, os_errors

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def check_plot(path: Path) -> None:
    """Raise UsageError for a file that cannot be drawn."""
    require_matplotlib("--plot")
    from matplotlib.backend_bases import FigureCanvasBase

    if path.suffix.lstrip(".").lower() not in FigureCanvasBase.filetypes:
        raise UsageError(f"--plot {path}: no picture ends in {path.suffix!r}; try .png, .svg, .pdf")


def draw(path: Path, fit: ResidualFit, flights: Sequence[FlightResidual]) -> None:
    """Draw a column for each flight and a row for each direction. Raises StorageError."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.0 + 4.0 * len(flights), 1.7 * len(fit.found)), layout="constrained")
    styled(lambda one: _draw(one, fit, flights))(figure)
    with os_errors(lambda why: f"--plot {path} cannot be written ({why}); choose another"):
        figure.savefig(path)


def _draw(figure: Figure, fit: ResidualFit, flights: Sequence[FlightResidual]) -> None:
    axes = grid(figure, len(fit.found), len(flights), sharex="col", sharey="row")
    shown = [one for one in directions(flights) if one.name in fit.found]
    for row, one in zip(axes, shown, strict=True):
        for axis, flight, terms, force in zip(row, flights, one.terms, one.forces, strict=True):
            known = fit.found[one.name].value * terms[:, 0]
            line(axis, flight.time, force, color=COLORS[0], label="residual")
            line(axis, flight.time, known, **DASHED, label="explained")
            line(axis, flight.time, force - known, color=COLORS[1], label="left", linewidth=0.8)
            rms = float(np.sqrt(np.mean((force - known) ** 2)))
            unit = "N" if one.name in "xyz" else "N m"
            finish(axis, f"{one.name}, {flight.name}: {rms:.3g} {unit} rms left", unit, narrow=True)
    for axis in axes[-1]:
        axis.set_xlabel("s")
