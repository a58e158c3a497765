"""Control laws that do harm in flight, and the time of a tick of each law.

    python -m benchmarks law_rescues

A law hovers well for some seconds and then does one of seven harms: it answers NaN or infinity,
asks for a jolt or for no thrust, creeps, or climbs. The built-in law has to take over and hold the
vehicle, with an event that says why; the payload and the wind of each flight are its own. A tick is
timed as machine code in processor time, so that its longest hundredth shows iterations that take
long, and not the computer's other work.
"""

from __future__ import annotations

import time
from unittest.mock import patch

import numpy as np

from benchmarks.flights.watched_flight import WatchedFlight
from benchmarks.harness import Report, Row, Size, Target
from control import laws
from control.parameters import GEOMETRIC
from extensions.laws.arena.cells import entries
from extensions.laws.arena.flights import tick_times
from extensions.laws.extension import EXTENSION
from extensions.laws.tests.harm import KINDS
from quadrotor.extension import Extension, Law
from quadrotor.extensions import Registry
from quadrotor.parameter_description import ParameterValue

HARM = Law(name="harm", target=".harm:LAW", parameters=".harm:HarmParameters")
HELD, CAUGHT = 0.75, 2.0
"""Largest distance (m) from the hover, of which a law that drifts away may take 0.5 m before it is
out (`control.plugin.distance_max`), and the time (s) for which the vehicle is watched after it."""
SLOW = {"nmpc": 2e-3}
"""Limits (s) of laws whose tick may take longer than TICK."""
TICK = 100e-6


def rescued(kind: int, seed: int) -> tuple[float, bool, bool]:
    """Return the largest distance (m) from the hover, whether the built-in law flies and the reason
    was told, and whether the vehicle fell.
    """
    rng = np.random.default_rng(seed)
    after, payload = float(rng.uniform(1.0, 4.0)), float(rng.uniform(0.0, 0.2))
    wind = dict(zip(("wind_x", "wind_y"), rng.uniform(-2.0, 2.0, 2).tolist(), strict=True))
    world = {f"simulator.{name}": value for name, value in wind.items()}
    values: dict[str, ParameterValue] = {
        **world,
        "simulator.drag": 0.2,
        "simulator.payload": payload,
        "control.law": "harm",
        "control.harm.kind": kind,
        "control.harm.after": after,
    }
    flight = WatchedFlight(seed, values)
    try:
        flight.hover(settling=0.0)
        flight.forget()
        flight.wait_until(
            lambda _: flight.stack.law.external is None, what="the rescue", timeout=15.0
        )
        flight.wait(CAUGHT)
        is_told = any("harm disengaged" in text for text in flight.events.texts)
        flies = flight.parameter("control.law") == GEOMETRIC
        _, places, wanted = flight.trace()
        away = float(np.linalg.norm(places - wanted, axis=1).max())
        return away, flies and is_told, flight.height < 0.3 or not flight.airborne
    finally:
        flight.stack.close()


def run(size: Size = Size.FULL, seed: int = 1) -> Report:
    """Run the benchmark for `python -m benchmarks`."""
    ours = Extension(name="ours", summary="", protocol=1, offers=(HARM,))
    declared = [("ours", "extensions.laws.tests", lambda: ours)]
    registry = Registry([*declared, ("laws", "extensions.laws", lambda: EXTENSION)])
    flights = size.of(143, 4, 1)  # of each harm: 1001 flights
    found = Report(
        "law_rescues",
        "Laws that do harm, and the ticks of laws",
        [f"{flights} flights of each harm, whole stack, simulated time, seeds from {seed}"],
    )
    untold = fallen = 0
    farthest = 0.0
    with patch.object(laws, "registry", lambda: registry):
        for kind, name in size.some(enumerate(KINDS)):
            ends = [rescued(kind, seed + k) for k in range(flights)]
            away = max(one[0] for one in ends)
            missed, fell = sum(not one[1] for one in ends), sum(one[2] for one in ends)
            figures = {"flights": flights, "not told": missed, "fell": fell, "farthest, m": away}
            found.rows.append(Row(name, {key: float(value) for key, value in figures.items()}))
            untold, fallen, farthest = untold + missed, fallen + fell, max(farthest, away)
    found.targets += [
        Target("laws that were not out and told", untold, 0.0),
        Target("falls", fallen, 0.0),
        Target("farthest from the hover, m", farthest, HELD),
    ]
    for name, entry in entries().items():
        times = tick_times(entry, size.of(20000, 5000, 100), time.thread_time)
        late = float(np.quantile(times, 0.99))
        median = 1e6 * float(np.median(times))
        found.rows.append(Row(f"tick of {name}", {"median, µs": median, "99 %, µs": 1e6 * late}))
        limit = SLOW.get(entry.law, TICK)
        found.targets.append(Target(f"tick of {name}, 99 %, µs", 1e6 * late, 1e6 * limit))
    return found
