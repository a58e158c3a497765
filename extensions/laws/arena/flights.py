"""The flights of the arena, and their figures: paired by seed, with intervals."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from control.controller import GeometricController
from control.laws import example_arguments, extended, new_control_parameters, settings_of
from control.parameters import GEOMETRIC
from control.trajectories.trajectory import Trajectory
from extensions.laws.arena.cells import DISTURBANCES, FEWER, Disturbance, Entry
from extensions.laws.arena.courses import PERIOD, courses
from extensions.laws.arena.results import Cell
from quadrotor.compiled import direct
from quadrotor.errors import UsageError
from quadrotor.extension import Function
from quadrotor.extensions import registry
from quadrotor.records import ACTUATORS, Array, new_reference, new_state
from quadrotor.vehicle_model import VehicleModel

HOVER = 8.0
"""s of hover before a course: what is judged is no longer the start's transient."""
TOLERATED = 2.0
"""Multiple of a law's error without latency up to which a latency counts as tolerated."""
FIRST_SEED = 101
"""First seed of the flights; no setting of a law was tried with these seeds."""


class Flown(NamedTuple):
    """The figures of the flights of a cell.

    Attributes:
        rms: m, error of the position in each flight; NaN for a crash.
        saturated: mean share of the ticks that saturated the motors; NaN if all crashed.
        effort: N/s, rms of the rate of a rotor's commanded thrust; NaN if all crashed.
    """

    rms: Array
    saturated: float
    effort: float


def door(name: str) -> Any:
    """Return a function of the extension batches. Raises UsageError where it is missing."""
    found = registry().offers(Function).get(name)
    if found is None:
        raise UsageError("the arena needs the extension batches, which is not installed")
    return found.load()


def fly_cell(
    entry: Entry, disturbance: Disturbance, course: Trajectory, seeds: Sequence[int]
) -> Flown:
    """Fly a course once for each seed."""
    fly_batch, scenario = door("batch"), door("Scenario")
    control, truth, model = entry.control(), disturbance.world(), disturbance.model(entry)
    one = partial(scenario, truth, model, control, tracker=disturbance.tracked())
    made = [one(trajectory=course, seed=seed, ground=False) for seed in seeds]
    own = {entry.law: entry.own.compiled} if entry.own else {}
    threads = 1 if own else None  # the law is one object
    flown = fly_batch(
        made,
        HOVER + course.duration,
        hover=HOVER,
        history_rate=1.0 / PERIOD,
        threads=threads,
        others=own,
    )
    rms = np.where(flown.crashed, np.nan, flown.outcome["position_rms"])
    if flown.crashed.all():
        return Flown(rms, math.nan, math.nan)
    thrusts = flown.history["thrusts"][~flown.crashed, round(HOVER / PERIOD) :]
    effort = math.sqrt(np.square(np.diff(thrusts, axis=1) / PERIOD).mean())
    return Flown(rms, float(flown.of_flown("saturated_share").mean()), effort)


def fly_arena(
    entries: Sequence[Entry],
    seeds: int,
    there: Mapping[str, Trajectory],
    tell: Callable[[str], None],
) -> Iterator[Cell]:
    """Fly every entry on every course under every disturbance, on the same seeds, the slow ones on
    the first of them.
    """
    for course, path in there.items():
        for name, disturbance in DISTURBANCES.items():
            tell(f"{course}, {name}")
            for entry in entries:
                own = max(2, seeds // FEWER.get(entry.name, 1))
                flown = fly_cell(entry, disturbance, path, range(FIRST_SEED, FIRST_SEED + own))
                yield Cell(entry.name, course, name, *flown)


def tolerated_latency(entry: Entry) -> float:
    """Return the longest latency of commands, in steps of 10 ms, at which the 8 in 8 s has at most
    TOLERATED times its error without; up to 100 ms.
    """
    eight = next(iter(courses().values()))
    still = fly_cell(entry, Disturbance(), eight, (1, 2)).rms.max()
    latency = 0.0
    for ms in range(10, 101, 10):
        rms = fly_cell(entry, Disturbance({"command_latency": 1e-3 * ms}), eight, (1, 2)).rms
        if not rms.max() <= TOLERATED * still:
            break
        latency = 1e-3 * ms
    return latency


def tick_times(entry: Entry, ticks: int, clock: Callable[[], float] = time.perf_counter) -> Array:
    """Return the times (ticks,) s of a law in machine code, on this computer."""
    law = entry.law
    if law == GEOMETRIC:
        controller, out = GeometricController(), np.zeros(1, ACTUATORS)
        controller.configure(new_control_parameters(), VehicleModel().record())
        state, reference = new_state(), new_reference()

        def step() -> None:
            controller.step(state, reference, True, 0.002, out)
    else:
        made = extended()[law].load() if entry.own is None else entry.own.compiled
        own = settings_of(new_control_parameters(), law)
        arguments = example_arguments(made, own)
        code: Callable[..., None] = direct(made.step, *arguments)

        def step() -> None:
            code(*arguments)

    times = np.empty(ticks)
    for k in range(ticks):
        began = clock()
        step()
        times[k] = clock() - began
    return times


def tick_time(entry: Entry, ticks: int = 5000) -> float:
    """Return the median time (s) of one tick of a law in machine code, on this computer."""
    return float(np.median(tick_times(entry, ticks)))
