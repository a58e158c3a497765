"""The experiment `closed_loop`: the 8 in compiled code, many flights at once (`quadlab.batch`)."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from console.evaluation.result import Result
from extensions.campaigns.plan import COMPILED
from quadrotor.errors import UsageError
from quadrotor.extension import Function
from quadrotor.extensions import registry
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters, Section, parameter
from quadrotor.records import Record
from quadrotor.similar_names import did_you_mean

if TYPE_CHECKING:
    from console.experiments.client import Client
    from extensions.campaigns.settings import Settings
    from quadlab.simulated.parameters import FlightParameters

FIGURES = {
    "position_rms_m": ("position_rms", 1.0),
    "position_max_m": ("position_max", 1.0),
    "yaw_rms_deg": ("yaw_rms", math.degrees(1.0)),
    "estimate_rms_m": ("estimate_rms", 1.0),
    "tilt_max_deg": ("tilt_max", math.degrees(1.0)),
    "saturated_share": ("saturated_share", 1.0),
}
"""Metrics with the figure of the compiled flight, and its unit in that of the metric."""
JUDGED = ("position_rms_m", "position_max_m", "yaw_rms_deg")


class ClosedLoopOptions(Parameters):
    """Options of the compiled flight."""

    duration: float = parameter(27.0, unit="s", ge=1.0, le=600.0, step=1.0)
    """of the whole flight"""
    hover: float = parameter(8.0, unit="s", ge=0.0, le=100.0, step=1.0)
    """before the 8, and the figures, begin"""
    disturbance_x: float = parameter(0.0, unit="N", ge=-20.0, le=20.0, step=0.1)
    """a constant force"""
    disturbance_y: float = parameter(0.0, unit="N", ge=-20.0, le=20.0, step=0.1)
    """a constant force"""
    disturbance_z: float = parameter(0.0, unit="N", ge=-20.0, le=20.0, step=0.1)
    """a constant force"""


class ClosedLoop:
    """The 8 in compiled code; it has no log."""

    name = COMPILED

    def __init__(self) -> None:
        self.parameters = ClosedLoopOptions()

    @property
    def planned(self) -> float:
        return self.parameters.duration

    def check(self) -> None:
        """Raise UsageError for a flight that ends before its figures begin."""
        p = self.parameters
        if p.hover >= p.duration:
            raise UsageError(
                f"experiment.hover = {p.hover:g} s is not below experiment.duration = "
                f"{p.duration:g} s; the figures begin after the hover"
            )

    def fly(self, client: Client) -> None:
        """Raise UsageError: only `fly_rows` flies it."""
        raise UsageError(f"{COMPILED} is flown by quadlab campaign only")

    def evaluate(self, log: Path) -> Result:
        """Raise UsageError: it has no log."""
        raise UsageError(f"{COMPILED} has no log")


def check_compiled(settings: Settings) -> None:
    """Check that the plan uses nothing that the compiled flight lacks. Raises UsageError."""
    plan = settings.file.plan
    lacking = {
        "board": plan.board != "mikrokopter",
        "law": plan.law not in ("", "geometric"),
        "estimator": plan.estimator not in ("", "complementary"),
        "plugins": bool(plan.plugins),
        "faults": bool(plan.faults),
        "keep.logs": plan.keep.logs != "none",
    }
    for name, is_lacking in lacking.items():
        if is_lacking:
            raise UsageError(f"{name}: {COMPILED} has none; fly figure_eight, or remove it")
    for name in (*plan.metrics, *plan.limits, *(plan.search.metrics if plan.search else ())):
        if name not in FIGURES:
            hint = did_you_mean(name, FIGURES) or f"there are {', '.join(FIGURES)}"
            raise UsageError(f"{COMPILED} has no metric {name!r}; {hint}")
    _door("batch")


def _door(name: str) -> Any:
    found = registry().offers(Function).get(name)
    if found is None:
        raise UsageError(f"{COMPILED} needs the extension batches, which is not installed")
    return found.load()


def fly_rows(
    settings: Settings, rows: Sequence[tuple[int, Mapping[str, ParameterValue]]]
) -> list[tuple[str, str, dict[str, float]]]:
    """Fly seeds with the values of their cells; return verdict, reason and metrics of each.

    Raises QuadlabError.
    """
    fly_batch, scenario = _door("batch"), _door("Scenario")
    alike: dict[tuple[float, float], list[int]] = defaultdict(list)
    made = []
    known: dict[int, FlightParameters] = {}  # consecutive flights share a cell
    for k, (seed, values) in enumerate(rows):
        if id(values) not in known:
            known[id(values)] = changed(settings.parameters, values)
        p = known[id(values)]
        options: ClosedLoopOptions = p.experiment  # type: ignore[attr-defined]
        force_w = options.disturbance_x, options.disturbance_y, options.disturbance_z
        made.append(
            scenario(
                truth=p.simulator,
                model=p.model,
                control=p.control,
                estimation=p.estimation,
                tracker=p.tracker,
                seed=seed,
                disturbance_w=force_w,
                true_state=settings.file.plan.true_state,
            )
        )
        alike[options.duration, options.hover].append(k)
    rate = float(settings.parameters.simulator.imu_rate)
    found: dict[int, tuple[str, str, dict[str, float]]] = {}
    for (duration, hover), places in alike.items():
        batch = [made[k] for k in places]
        flown = fly_batch(batch, duration, hover=hover, control_rate=rate, threads=1)
        found |= zip(places, _told(flown.outcome), strict=True)
    return [found[k] for k in range(len(rows))]


def _told(outcome: Record) -> Iterator[tuple[str, str, dict[str, float]]]:
    columns = {name: (unit * outcome[of]).tolist() for name, (of, unit) in FIGURES.items()}
    crashed, times = outcome["crashed"].tolist(), outcome["crash_time"].tolist()
    for k in range(len(outcome)):
        if crashed[k]:
            yield "failed", f"crashed after {times[k]:.3f} s", {}
        else:
            yield "passed", "", {name: values[k] for name, values in columns.items()}


def changed(parameters: Section, values: Mapping[str, ParameterValue]) -> Section:
    """Return a tree of parameters with other values; parts without any are shared, not copied."""
    inside: dict[str, dict[str, ParameterValue]] = defaultdict(dict)
    update: dict[str, object] = {}
    for name, value in values.items():
        part, _, rest = name.partition(".")
        if rest:
            inside[part][rest] = value
        else:
            update[part] = value
    for part, within in inside.items():
        update[part] = changed(getattr(parameters, part), within)
    return parameters.model_copy(update=update)
