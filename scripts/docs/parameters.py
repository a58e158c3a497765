"""docs/parameters.md, made from the models: every parameter with unit, bounds and meaning."""

from __future__ import annotations

from collections.abc import Iterable

from quadrotor.parameter_description import ParameterDescription
from quadrotor.parameters import Parameters, ParameterStore

ABOVE = ("tracker.", "bearings.")
"""Prefixes of station parameters that have a separate section."""
HEAD = "| name | default | allowed | unit | meaning |\n|---|---|---|---|---|\n"


def page() -> str:
    """Return the whole page as Markdown."""
    from bearing_sim.emulator import BearingParameters
    from bearing_sim.tracker import TrackerParameters
    from console.parameters.station import station_parameters
    from extensions.mavlink.parameter_names import has_short_name, is_faithful, short_name
    from quadrotor.extension import Board, SimulatedSensor
    from quadrotor.extensions import registry
    from vehicle.boards.kind import find_kind
    from vehicle.parameters import new_parameters
    from vehicle.simulator.parameters import SimulatorParameters

    trees: list[tuple[str, str, Parameters]] = [
        ("Vehicle", "", new_parameters()),
        ("Simulator", "simulator.", SimulatorParameters()),
        ("Tracker", "tracker.", TrackerParameters()),
        ("Bearings", "bearings.", BearingParameters()),
        *(
            (f"Sensor {name}, of quadlab fly", f"{name}.", one.load(one.offer.parameters)())
            for name, one in registry().offers(SimulatedSensor).items()
        ),
        *(
            (f"Board {name}", "board.", options())
            for name in registry().offers(Board)
            if (options := find_kind(name).options) is not None
        ),
        ("Station", "station.", station_parameters()),
    ]
    parts = [
        "# Parameters\n\n"
        "Written by `scripts/parameters_page` from the models in the code; do not edit.\n"
        "Set one with `--set NAME=VALUE`, on the Gains tab, or with `ros2 param set`.\n"
    ]
    for title, prefix, tree in trees:
        parts.append(f"\n## {title}\n\n")
        described = ParameterStore(tree).descriptions()
        if prefix == "station.":
            parts.append("Those of tracker and bearings above are there, too.\n\n")
            described = tuple(d for d in described if not d.name.startswith(ABOVE))
        parts.append(HEAD)
        parts.extend(_rows(prefix, described))
        if title == "Vehicle":
            parts.append("\n### Short names, for MAVLink\n\n| short name | name |\n|---|---|\n")
            named = filter(is_faithful, filter(has_short_name, described))
            parts.extend(f"| `{short_name(d.name)}` | `{d.name}` |\n" for d in named)
    return "".join(parts)


def _rows(prefix: str, descriptions: Iterable[ParameterDescription]) -> Iterable[str]:
    for d in descriptions:
        allowed = ", ".join(d.choices)
        if d.minimum is not None and d.maximum is not None:
            allowed = f"{d.minimum:g} … {d.maximum:g}"
        unit, name = d.unit, prefix + d.name
        if d.flight_step is not None:
            allowed = f"{allowed}; {d.flight_step:g} at once in flight".removeprefix("; ")
        default = f"{d.default:g}" if isinstance(d.default, float) else str(d.default)
        fixed = " (at start only)" if d.read_only else ""
        yield f"| `{name}` | {default} | {allowed} | {unit} | {d.description}{fixed} |\n"
