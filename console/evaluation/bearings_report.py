"""The four plots of one flight as in Fig. 6, and its figures as Markdown."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from console.evaluation.alignment import roll_pitch_yaw
from console.evaluation.bearings import BearingsFlight
from console.evaluation.result import Result
from console.plots import require_matplotlib, state_estimation, styled
from quadrotor.parameters import Parameters


def write(flight: BearingsFlight, options: Parameters, result: Result, stem: Path) -> list[Path]:
    """Write STEM.png and STEM.md. Raises UsageError when matplotlib is not installed."""
    require_matplotlib()
    from matplotlib.figure import Figure

    picture, text = stem.with_suffix(".png"), stem.with_suffix(".md")
    first = flight.time[0]
    truth, estimate = flight.truth, flight.estimate
    angles, estimated = (roll_pitch_yaw(x[:, 6:]) for x in (truth, estimate))

    def draw(figure: Figure) -> None:
        state_estimation(
            figure,
            flight.time - first,
            position=(truth[:, :3], estimate[:, :3]),
            angles=(angles, estimated),
            position_error=(truth - estimate)[:, :3],
            turn=flight.turns,
            judged=[(flight.window[0] - first, flight.window[1] - first)],
        )

    figure = Figure(figsize=(10.0, 6.4), layout="constrained")
    styled(draw)(figure)
    figure.savefig(picture, dpi=120)
    title = "Flight on bearings"
    text.write_text(figures_as_text(title, options, result, flight.fell_back, picture.name))
    return [picture, text]


def figures_as_text(
    title: str, options: Parameters, result: Result, notes: Iterable[str], picture: str
) -> str:
    """Return verdict, options, notes and figures as Markdown, with a picture of this file name."""
    lines = [f"# {title}", "", f"Verdict: **{result.verdict.replace('_', ' ')}**", ""]
    lines += [result.reason, ""] if result.reason else []
    lines += [f"- `experiment.{name}` = {value}" for name, value in options]
    lines += [f"- {text}" for text in notes]
    lines += ["", "| figure | value | at most |", "|---|---:|---:|"]
    for name, value in result.metrics.items():
        limit = result.limits.get(name)
        lines.append(f"| {name} | {value:.5g} | {'' if limit is None else f'{limit:g}'} |")
    return "\n".join([*lines, "", f"![the flight in four plots]({picture})", ""])
