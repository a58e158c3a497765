"""Control laws that do harm in flight, and the time of a tick of each law.

    python -m benchmarks law_rescues
    python -m benchmarks law_rescues --flights 1 --seed 7    # one of each kind

Every compiled law of an extension flies the whole vehicle in simulated time, and from a moment on
its answers do harm: they are not finite, have a wrong sign, swing, stay the same for ever, or lead
away slowly within their bounds. The built-in law has to take over and save the vehicle, with an
event that says why; payload, wind and moment of each flight are its own. A law that hangs or dies
has a process of its own, and is flown by `hostile_plugins`.

A vehicle fell when it tilted by more than TILT, touched the ground faster than HARD, sank below
LOWEST in a hover or on a course, or stopped its motors in the air.

A tick is timed as machine code in processor time, so that its longest hundredth shows iterations
that take long, and not the computer's other work.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from unittest.mock import patch

import numpy as np

from benchmarks.flights.watched_flight import WatchedFlight
from benchmarks.harness import Report, Row, Size, Target
from control.laws import extended
from control.parameters import GEOMETRIC
from extensions.laws.arena.cells import entries
from extensions.laws.arena.flights import tick_times
from extensions.laws.tests.harm import WAYS, Harm
from quadrotor.parameter_description import ParameterValue
from vehicle.laws import compiled
from vehicle.laws.offer import offer_laws

TILT, HARD, LOWEST = math.radians(75.0), 1.0, 0.3
"""Limits of a fall: rad, m/s, m."""
LONGEST, CAUGHT = 20.0, 2.0
"""s in which a harm has to end, and for which the vehicle is watched after it."""
SLOW = {"nmpc": 2e-3}
"""Limits (s) of laws whose tick may take longer than TICK."""
TICK = 100e-6


def _take_off(flight: WatchedFlight) -> None:
    flight.wait_until(lambda v: v.mode == "ready", what="ready", timeout=20)
    flight.wait(0.2)
    flight.arm()
    flight.wait(0.5)
    flight.start("take_off", height=1.0, speed=1.0)


def _taking_off(flight: WatchedFlight, rng: np.random.Generator) -> None:
    height = float(rng.uniform(0.2, 0.7))
    _take_off(flight)
    flight.wait_until(lambda _: flight.height > height, what="the height", timeout=10.0)


def _hovering(flight: WatchedFlight, rng: np.random.Generator) -> None:
    _take_off(flight)
    flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=10.0)
    flight.wait(float(rng.uniform(0.0, 2.0)))


def _on_a_course(flight: WatchedFlight, rng: np.random.Generator) -> None:
    _hovering(flight, rng)
    flight.start("follow_trajectory", trajectory="figure_eight", laps=2)
    flight.wait(float(rng.uniform(3.0, 8.0)))


def _landing(flight: WatchedFlight, rng: np.random.Generator) -> None:
    height = float(rng.uniform(0.2, 0.7))
    _hovering(flight, rng)
    flight.start("land")
    flight.wait_until(lambda _: flight.height < height, what="the height", timeout=10.0)


MOMENTS: dict[str, Callable[[WatchedFlight, np.random.Generator], None]] = {
    "take-off": _taking_off,
    "hover": _hovering,
    "figure 8": _on_a_course,
    "landing": _landing,
    "taking over": _hovering,
}
"""When the harm begins; the last is the first tick of a law that is chosen in flight."""


@dataclass(frozen=True)
class Rescue:
    """The end of one flight.

    Attributes:
        is_told: whether the built-in law flies, and an event says that it took over; or the law had
            landed before it was out.
        why: the reason of a fall; empty for none.
        away: m, largest distance from the reference.
    """

    law: str
    moment: str
    way: str
    is_told: bool
    why: str
    away: float


def rescued(law: str, moment: str, way: str, seed: int) -> Rescue:
    """Fly a law that does harm."""
    rng = np.random.default_rng(seed)
    world = dict(zip(("wind_x", "wind_y"), rng.uniform(-2.0, 2.0, 2).tolist(), strict=True))
    world |= {"drag": 0.2, "payload": float(rng.uniform(0.0, 0.2))}
    values: dict[str, ParameterValue] = {f"simulator.{name}": x for name, x in world.items()}
    takes_over = moment == "taking over"
    values["control.shadow_law" if takes_over else "control.law"] = law
    harm = Harm()
    with patch.object(compiled, "direct", harm.direct):
        flight = WatchedFlight(seed, values)
        try:
            MOMENTS[moment](flight, rng)
            flight.forget()
            harm.way = way
            if takes_over:
                flight.change({"control.law": law})
            is_out = _is_out_within(flight, LONGEST)
            flight.wait(CAUGHT)
            told = is_out and any(f"{law} disengaged" in text for text in flight.events.texts)
            landed = moment == "landing" and not flight.airborne
            _, places, wanted = flight.trace()
            away = float(np.linalg.norm(places - wanted, axis=1).max())
            return Rescue(law, moment, way, told or landed, _fell(flight, moment), away)
        finally:
            flight.stack.close()


def _is_out_within(flight: WatchedFlight, longest: float) -> bool:
    end_ns = flight.stack.stamp_ns + round(1e9 * longest)
    while flight.stack.law.external is not None and flight.stack.stamp_ns < end_ns:
        flight.advance()
    return flight.parameter("control.law") == GEOMETRIC


def _fell(flight: WatchedFlight, moment: str) -> str:
    if flight.most_tilted > TILT:
        return f"tilted by {math.degrees(flight.most_tilted):.0f}°"
    if flight.hardest > HARD:
        return f"touched down at {flight.hardest:.2f} m/s"
    if moment != "landing" and (flight.height < LOWEST or not flight.airborne):
        return f"at {flight.height:.2f} m"
    return ""


def run(size: Size = Size.FULL, flights: int = 3, seed: int = 1) -> Report:
    """Run the benchmark for `python -m benchmarks`, from the first seed on."""
    flights = size.of(flights, 1, 1)
    offer_laws(None)
    kinds = list(product(size.some(extended()), size.some(MOMENTS), size.some(WAYS)))
    found = Report(
        "law_rescues",
        "Laws that do harm, and the ticks of laws",
        [f"{flights} flights of each law, moment and harm, whole stack, seeds from {seed}"],
    )
    ends = [rescued(*kind, seed + k) for kind in kinds for k in range(flights)]
    for what in ("law", "moment", "way"):
        for name in dict.fromkeys(getattr(one, what) for one in ends):
            found.rows.append(_row(name, [one for one in ends if getattr(one, what) == name]))
    found.notes += [
        f"{one.law}, {one.moment}, {one.way}: {one.why or 'is not out'}"
        for one in ends
        if one.why or not one.is_told
    ]
    found.targets += [
        Target("laws that were not out and told", sum(not one.is_told for one in ends), 0.0),
        Target("falls", sum(bool(one.why) for one in ends), 0.0),
    ]
    for name, entry in entries().items():
        times = tick_times(entry, size.of(20000, 5000, 100), time.thread_time)
        late = float(np.quantile(times, 0.99))
        median = 1e6 * float(np.median(times))
        found.rows.append(Row(f"tick of {name}", {"median, µs": median, "99 %, µs": 1e6 * late}))
        limit = SLOW.get(entry.law, TICK)
        found.targets.append(Target(f"tick of {name}, 99 %, µs", 1e6 * late, 1e6 * limit))
    return found


def _row(name: str, ends: list[Rescue]) -> Row:
    figures = {
        "flights": float(len(ends)),
        "not told": float(sum(not one.is_told for one in ends)),
        "fell": float(sum(bool(one.why) for one in ends)),
        "farthest, m": max(one.away for one in ends),
    }
    return Row(name, dict(figures))
