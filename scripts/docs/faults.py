"""docs/how_to/faults.md and the page's table of faults, made from the declarations."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from bearing_sim.faults import bearings, tracker
from bearing_sim.faults.fault import Catalogue
from bearing_sim.faults.schedule import LONGEST, WORDS
from quadrotor.parameter_description import ParameterDescription
from quadrotor.parameters import ParameterStore
from vehicle.simulator.faults import table

CATALOGUES: tuple[Catalogue, ...] = (table.CATALOGUE, tracker.CATALOGUE, bearings.CATALOGUE)

HEAD = """# Faults with schedules

Written by `scripts/faults_page` from the declarations in the code; do not edit.

A simulated laboratory can have the faults below, several at once, each on a schedule of its own.
A flight with the same seed and the same faults is the same flight. Without faults nothing is
drawn, computed or changed for them.

    quadlab fly hover --set faults="tracker.freeze from=12 for=0.5; barometer.ramp rate=15 from=10"
    quadlab up --set faults="motors.fade motor=left gain=0.8 from=20 ramp=5"

A text holds faults separated by semicolons: a name, then `name=value` words for the fault and for
its schedule. `faults` divides the text among three parameters, which can also be set alone, on
the page, by an experiment of `quadlab fly` or with `ros2 param set`, at the start and in flight:
`simulator.faults`, `tracker.faults` and `bearings.faults` (the last two are
`station.tracker.faults` and `station.bearings.faults` while a station runs). A wrong text is
refused in one line and changes nothing.

Faults of the tracker are those of the simulated one: with `quadlab tracker` they act only where the
simulator serves its poses (`--serve`, [tracking systems](../trackers.md)).

Every parameter of the simulator, the tracker and the bearings that can change in flight can be
moved by the same schedules: its name with `value`, like `simulator.payload value=0.3 from=15
to=25`, `simulator.gust value=2 share=0.3 spell=2` or `tracker.delay value=0.1 ramp=10`. This is
how wind, gusts, pushes, payload, failed motors, vibration, lost samples, radio loss, unplugged
ports, dropped poses, outliers, delays and the rate of the poses are scheduled
([parameters](../parameters.md)).

On the page they are under SIMULATION, *Wind and faults*: the wind, the gusts and the payload as
sliders, the faults with start and stop, and one button that removes all of them.

## Schedules
"""

AFTER = f"""
- Without a word a fault is on from the moment it is set until it is taken out. Its clock starts
  when it is set: at the first sample, or in flight. An entry that stays as it is while others
  come and go keeps its clock.
- From `from` on, before `to`: a sample at the very end is without the fault. An end that is not
  given is after {LONGEST:g} s.
- `every` and `for` make it periodic, and every period begins like the first one: ramps and drifts
  start again. With the period of a trajectory's lap it comes at the same place of each lap.
- `share` and `spell` make it random. The seed is that of simulator, tracker or bearings.
- Two faults of one name may not overlap, except on different motors, axes, sensors or beacons.
- When a fault ends, what it had moved is back at once.
- `quadlab fly` names the faults that would have begun after the end of the flight.
- Faults act once for each sample or pose. Batches (`extensions.batches`) refuse them.

## Faults
"""


def page() -> str:
    """Return the whole page as Markdown."""
    parts = [HEAD, "\n| word | default | allowed | unit | meaning |\n|---|---|---|---|---|\n"]
    parts.extend(_row(word, one) for word, one in WORDS.items())
    parts.append(AFTER)
    for catalogue in CATALOGUES:
        parts.append(f"\n### In `{catalogue.home}`\n\n")
        parts.append(
            "| fault | physics | source | its words: default, allowed |\n|---|---|---|---|\n"
        )
        for name, declared in catalogue.faults.items():
            words = "<br>".join(map(_words, ParameterStore(declared()).descriptions()))
            parts.append(f"| `{name}` | {_physics(declared)} | {declared.source} | {words} |\n")
    parts.append(
        "\nAir acts through drag and loss of thrust, which the clean simulator has not: give it "
        "some, for instance with\n`simulator.preset=rough`. A board other than the paper's refuses "
        "`imu.gaps`: it sends a stream of bytes and no\nsamples that could be lost.\n"
    )
    return "".join(parts)


def page_table() -> str:
    """Return the table that the page's panel is made from, as JSON."""
    faults = [
        {
            "name": name,
            "home": catalogue.home,
            "physics": _physics(declared).replace("`", ""),
            "words": [_described(one) for one in ParameterStore(declared()).descriptions()],
        }
        for catalogue in CATALOGUES
        for name, declared in catalogue.faults.items()
    ]
    schedule = [_described(one) | {"name": word} for word, one in WORDS.items()]
    rows = ",\n".join(json.dumps(one, ensure_ascii=False) for one in faults)
    return f'{{"schedule": {json.dumps(schedule, ensure_ascii=False)},\n"faults": [\n{rows}\n]}}\n'


def _physics(declared: Any) -> str:
    return " ".join(str(declared.__doc__).split())


def _described(one: ParameterDescription) -> dict[str, Any]:
    found: dict[str, Any] = {"name": one.name, "type": one.type, "default": one.default}
    found |= {"minimum": one.minimum, "maximum": one.maximum, "choices": one.choices}
    return found | {"step": one.step, "unit": one.unit, "description": one.description}


def _allowed(one: ParameterDescription) -> Iterator[str]:
    if one.choices:
        yield ", ".join(one.choices)
    elif one.minimum is not None and one.maximum is not None:
        yield f"{one.minimum:g} … {one.maximum:g}"


def _default(one: ParameterDescription) -> str:
    return f"{one.default:g}" if isinstance(one.default, float) else str(one.default)


def _row(word: str, one: ParameterDescription) -> str:
    allowed = "".join(_allowed(one))
    return f"| `{word}` | {_default(one)} | {allowed} | {one.unit} | {one.description} |\n"


def _words(one: ParameterDescription) -> str:
    allowed = "".join(_allowed(one)) + f" {one.unit}".rstrip()
    return f"`{one.name}` {_default(one)}, {allowed}: {one.description}"
