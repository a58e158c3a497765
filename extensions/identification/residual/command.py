"""`quadlab identify residual LOG…`: what the model leaves unexplained in recorded flights."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from quadlab.log_commands.log_file import check_log_file
from quadlab.option_types import File, Flag, optional
from quadrotor.errors import UsageError

if TYPE_CHECKING:
    from extensions.identification.residual.fit import ResidualFit


@dataclass
class Identify:
    """Fit drag by axis, its height and the loss of thrust to the forces that the model does not
    explain in recorded flights.

    The residual is the force and torque that the rotors' model does not explain; the height is over
    the centre of mass. Each value is judged by flights that its fit has not seen.
    """

    what: Annotated[Literal["residual"], tyro.conf.Positional]
    """what to fit"""
    logs: Annotated[tuple[Path, ...], tyro.conf.Positional, optional("LOG [LOG …]")]
    """logs of one vehicle; of a single one, thirds are judged by the others"""
    name: str = "quad1"
    """namespace of the vehicle's topics"""
    plot: File = None
    """draw the residual, what is explained and what is left"""
    json: Flag = False
    """print the result as one line of JSON"""

    def run(self) -> int:
        if not self.logs:
            raise UsageError("LOG is missing; give one log of a flight or more")
        for log in self.logs:
            check_log_file(log)
        from extensions.identification.residual import figure
        from extensions.identification.residual.fit import fit_residual
        from extensions.identification.residual.flights import read_residual

        if self.plot is not None:
            figure.check_plot(self.plot)
        flights = [read_residual(log, self.name) for log in self.logs]
        fit = fit_residual(flights)
        if self.plot is not None:
            figure.draw(self.plot, fit, flights)
        if self.json:
            print(json.dumps({**asdict(fit), "model": fit.model(), "simulator": fit.simulator()}))
        else:
            print("\n".join(_lines(fit, len(flights))))
        return 0


def _lines(fit: ResidualFit, flights: int) -> list[str]:
    of = f"{flights} flights" if flights > 1 else "thirds of the flight"
    lines = [f"share of the residual explained, each of {of} by a fit to the others:"]
    for one in fit.found.values():
        value = f"{one.value:.4f} ± {one.deviation:.4f} {one.unit}"
        unit = "N" if one.name in "xyz" else "N m"
        left = f"{one.rms:.3g} {unit} rms, {one.left:.3g} left"
        share = f"{100 * one.explained:.0f} %, with more terms {100 * one.by_all:.0f} %"
        lines.append(f"  {one.name:<6} {value:<26} {share:<30} {left}")
        if not one.good:
            lines.append(f"  {one.name} is not proposed: it explains nothing, or is not clear of 0")
    for axis, rms in fit.quiet.items():
        lines.append(f"  {axis}: not excited, {rms:.2f} m/s rms; nothing is known along it")
    for whose, values in (("the vehicle", fit.model()), ("the simulator", fit.simulator())):
        if values:
            words = " ".join(f"{name}={value:.3f}" for name, value in values.items())
            lines.append(f"for {whose}: --set {words}")
    return lines
