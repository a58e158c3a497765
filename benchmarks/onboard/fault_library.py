"""Hovers with each fault of the simulated laboratory: how far off, how tilted, how they end.

    python -m benchmarks fault_library

The vehicle hovers at 1 m on poses in simulated time. Then one fault comes on for some seconds, as
declared (docs/how_to/faults.md), and the flight is watched until after it. Faults of the air are
flown in the rough world, whose vehicle has drag. Faults of the bearings are left out: nothing here
flies on bearings.
"""

from __future__ import annotations

import math

import numpy as np

from bearing_sim.faults import tracker
from benchmarks.flights.watched_flight import WatchedFlight
from benchmarks.harness import Report, Row, Size
from quadrotor.parameter_description import ParameterValue
from vehicle.simulator.faults import table
from vehicle.simulator.presets import ROUGH

SEEDS = (3, 1, 1)  # of each size
LASTS, WATCHED = 3.0, 9.0
"""Duration, in s, of each fault and of the flight from its beginning on."""
WORDS = {"tracker.clock": " step=0.2 drift=1000", "world.wall": " at=0.5"}
"""Words of faults that do nothing as they are declared, or nothing at the hover's place."""
HARD = 1.0
"""Speed at the ground, in m/s, beyond which a landing is a crash."""
Outcome = tuple[float, float, float, str]
"""Largest distance from the reference in m, horizontal one from the hover at the end in m, largest
tilt in deg, and how the flight ended."""


def fly(seed: int, name: str, home: str, size: Size) -> Outcome:
    """Fly once with a fault."""
    rough = ROUGH if name.startswith("world.") else {}
    settings: dict[str, ParameterValue] = {f"simulator.{key}": v for key, v in rough.items()}
    flight = WatchedFlight(seed, settings)
    flight.hover(settling=size.of(3.0, 3.0, 0.2))
    flight.forget()
    lasts = size.of(LASTS, LASTS, 0.1)
    flight.change({home: f"{name}{WORDS.get(name, '')} for={lasts:g}"})
    flight.run(size.of(WATCHED, WATCHED, 0.2))
    _, places, wanted = flight.trace()
    away = float(np.linalg.norm(places - wanted, axis=1).max())
    crashed = flight.hardest > HARD or flight.most_tilted > math.radians(80.0)
    ended = "crashed" if crashed else "flies on" if flight.airborne else "landed"
    aside = float(np.hypot(*(places[-1] - wanted[0])[:2]))
    return away, aside, math.degrees(flight.most_tilted), ended


def run(size: Size = Size.FULL) -> Report:
    seeds = range(1, 1 + size.of(*SEEDS))
    report = Report(
        "fault_library",
        "What each fault does to a hover",
        [
            f"on poses, gains `standard`, {len(seeds)} seeds each; each fault as declared, for "
            f"{LASTS:g} s; {WATCHED:g} s are watched from its beginning on",
            f"crashed: faster than {HARD:g} m/s at the ground, or tilted by more than 80°",
        ],
    )
    homes = {name: one.home for one in (table.CATALOGUE, tracker.CATALOGUE) for name in one.faults}
    names = list(homes)[: size.of(len(homes), len(homes), 2)]
    for name in names:
        found = [fly(seed, name, homes[name], size) for seed in seeds]
        ended = [end for *_, end in found]
        figures: dict[str, float | str] = {
            "largest distance, m": max(away for away, *_ in found),
            "aside at the end, m": max(aside for _, aside, *_ in found),
            "largest tilt, °": max(tilt for _, _, tilt, _ in found),
            "ended": ", ".join(f"{ended.count(end)} {end}" for end in dict.fromkeys(ended)),
        }
        report.rows.append(Row(name, figures))
    return report
