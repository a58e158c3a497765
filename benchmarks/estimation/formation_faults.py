"""Formations with a fault: collisions, whether the faulty vehicle is named, and how the rest flies.

Five vehicles without dynamics but a lag of 0.25 s, with the programs on board of `quadlab fly
formation`, converge from random starts, are steered in all null motions, and meet the fault.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.harness import Report, Row, Size, Target
from extensions.formations.mathematics.steering import NullMotion
from extensions.formations.options import FormationOptions
from extensions.formations.shape import FACING, shape_of
from extensions.formations.starts import random_starts, starts_near
from extensions.formations.tests.flock import Flock

COUNT, FAULTY = 5, 2
LAG = 0.25
CONVERGE, FAULT_AT, END, STEP = 9.0, 12.0, 24.0, 0.25
"""s: steered from, fault at, end; between two commands."""
TOUCH = 2.0 * 0.377
"""m between the centres of two vehicles that touch."""
NAME = f"quad{FAULTY + 1}"


@dataclass(frozen=True)
class Case:
    """A fault.

    Attributes:
        of_one: sets the options of the faulty vehicle, of_all those of all.
        line: what its event says, beside its name; "" where none is expected.
        happens: what happens to the flock at FAULT_AT.
        left: whether the faulty vehicle is no part of the formation afterwards.
    """

    title: str
    line: str = ""
    of_one: Callable[[FormationOptions], None] = lambda one: None
    of_all: Callable[[FormationOptions], None] = lambda one: None
    happens: Callable[[Flock], None] = lambda flock: None
    left: bool = False


def _set(group: str, field: str, value: object) -> Callable[[FormationOptions], None]:
    return lambda one: setattr(getattr(one, group) if group else one, field, value)


def _lands(flock: Flock) -> None:
    flock.land(FAULTY)


def _facing(one: FormationOptions) -> None:
    one.desired, one.bearings.field_of_view, one.bearings.mount_pitch = FACING, 90.0, -90.0


CASES = (
    Case("one lands", "has left", happens=_lands, left=True),
    Case("link of one cut", "silent", of_one=_set("messages", "cut", FAULT_AT), left=True),
    Case("bearings of one turned by 10°", "contradict", of_one=_set("bearings", "bias_z", 10.0)),
    Case("identities of one swapped", "contradict", of_one=_set("bearings", "swap", 1.0)),
    Case("field of view 90°", of_all=_facing),
    Case("messages 200 ms late", of_all=_set("messages", "delay", 0.2)),
    Case("10 % of the messages lost", of_all=_set("messages", "loss", 0.1)),
    Case("30 % of the messages lost", of_all=_set("messages", "loss", 0.3)),
    Case("60 % of the messages lost", of_all=_set("messages", "loss", 0.6)),
)


def run(size: Size = Size.FULL) -> Report:
    """Run all cases."""
    count = size.of(100, 5, 1)
    report = Report(
        "formation_faults",
        "Formations with a fault",
        [
            f"{count} flights a row of {COUNT} vehicles without dynamics but a lag of {LAG:g} s, "
            f"from random starts; steered from {CONVERGE:g} s in all null motions at 0.5 m/s, "
            f"0.3 rad/s, 10 %/s; fault at {FAULT_AT:g} s where it is not there from the start",
            "error: rms of the true bearings of the others, from 2 s after the fault to the end "
            f"at {END:g} s, the worst flight; eigenvalue: the smallest that a vehicle knew",
        ],
    )
    for case in size.some(CASES):
        flown = [fly(case, seed) for seed in range(1, count + 1)]
        nearest, errors, eigenvalues, named = (list(one) for one in zip(*flown, strict=True))
        collisions = sum(one < TOUCH for one in nearest)
        figures: dict[str, float | str] = {
            "collisions": float(collisions),
            "nearest, m": min(nearest),
            "error, deg": max(errors),
            "eigenvalue": min(eigenvalues),
        }
        if case.line:
            figures["named"] = f"{sum(named)} of {count}"
        report.rows.append(Row(case.title, figures))
        report.targets.append(Target(f"{case.title}: collisions", float(collisions), 0.0))
        if case.line:
            share = sum(named) / count
            report.targets.append(Target(f"{case.title}: share named", share, 1.0, at_most=False))
    return report


def fly(case: Case, seed: int) -> tuple[float, float, float, bool]:
    """Return the smallest distance (m), the error (deg), the smallest eigenvalue, and whether each
    vehicle of the rest has named the faulty one.
    """
    options = [FormationOptions().model_copy(deep=True) for _ in range(COUNT)]
    for k, one in enumerate(options):
        case.of_all(one)
        one.bearings.seed = 1000 * seed + k
    case.of_one(options[FAULTY])
    random = np.random.Generator(np.random.PCG64(seed))
    shape = shape_of(options[0].desired, COUNT)
    near = options[0].desired == FACING
    starts = starts_near(shape.places, seed, 0.1) if near else random_starts(shape.places, seed)
    heights = random.uniform(0.9, 1.5, COUNT)
    if near:
        size = (starts[0][0] - starts[1][0]) / (shape.places[0, 0] - shape.places[1, 0])
        heights = 1.5 + size * shape.places[:, 2]
    turn = 0.15 if near else 1.0
    yaws = shape.yaws + random.uniform(-turn, turn, COUNT)
    flock = Flock(options, np.column_stack([starts, heights]), yaws, LAG)
    flock.begin()
    flock.fly(CONVERGE)
    squares, least, time = [], math.inf, CONVERGE
    while time < END:
        if time == FAULT_AT:
            case.happens(flock)
        since = time - CONVERGE
        for pilot in flock.pilots:
            pilot.command = NullMotion(
                (0.5 * math.cos(since), 0.25 * math.sin(since), 0.0),
                0.3 * math.cos(0.8 * since),
                0.1 * math.cos(0.6 * since),
            )
        flock.fly(STEP)
        time += STEP
        if time > FAULT_AT + 2.0:
            squares.append(flock.error([FAULTY] if case.left else []) ** 2)
        least = min(least, *_eigenvalues(flock, case.left))
    others = [here for here in flock.all if here.index != FAULTY]
    named = all(any(case.line in line and NAME in line for line in here.events) for here in others)
    return flock.nearest, math.sqrt(sum(squares) / len(squares)), least, named


def _eigenvalues(flock: Flock, left: bool) -> list[float]:
    """Return the eigenvalues that the vehicles know, without the faulty one where it has left."""
    pilots = enumerate(flock.pilots)
    return [one.eigenvalue for k, one in pilots if one.is_flying and not (left and k == FAULTY)]
