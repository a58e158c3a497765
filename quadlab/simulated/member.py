"""A process that flies some of the vehicles that fly together in simulated time.

`python -m quadlab.simulated.member ORDER` flies them; `quadlab.simulated.together` starts it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import msgspec

from console.evaluation.result import Result
from console.experiments.client import Client, Experiment
from console.experiments.together import Together
from quadlab.simulated.flight import SimulatedFlight
from quadlab.simulated.flight_log import FlightLog
from quadlab.simulated.meeting import Meeting
from quadlab.simulated.neighbours import Collision, Neighbours
from quadlab.simulated.turns import Turns
from quadrotor.errors import QuadlabError
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle_link.jobs import die_with_parent

LAST = 60.0
"""Longest time, s, that a vehicle whose experiment has failed takes to come down."""


class Vehicle(msgspec.Struct, kw_only=True):
    """A vehicle that a process is to fly.

    Attributes:
        index: from 0. words: NAME=VALUE of parameters. log: a new file.
    """

    index: int
    seed: int
    words: list[str]
    log: str


class Order(msgspec.Struct, kw_only=True):
    """The order of a process.

    Attributes:
        parent: process that started it. names: of all vehicles. vehicles: those to fly.
        files: of the meeting. answer: file for the answers.
    """

    parent: int
    names: list[str]
    vehicles: list[Vehicle]
    files: list[int]
    answer: int
    experiment: str
    plugins: str
    board: str
    true_state: bool


@dataclass
class Answer:
    """The result of a vehicle's flight.

    Attributes:
        verdict, reason, metrics, limits: of its own result.
        flown: s of simulated time.
        separations: smallest distances (m) from the others.
    """

    verdict: str
    reason: str
    metrics: dict[str, float]
    limits: dict[str, float]
    flown: float
    separations: dict[str, float]
    collisions: list[Collision]

    @property
    def result(self) -> Result:
        """Return its own result."""
        return Result(self.verdict, self.metrics, self.limits, self.reason)


@dataclass
class Answers:
    """The results of the vehicles of a process, by index.

    Attributes:
        wall, processor: s. error: why the process has ended early.
    """

    vehicles: dict[int, Answer] = field(default_factory=dict)
    wall: float = 0.0
    processor: float = 0.0
    error: str = ""


class Member:
    """A vehicle's place among several.

    Attributes:
        name: of the vehicle. log: its file.
    """

    def __init__(self, meeting: Meeting, names: Sequence[str], of: Vehicle) -> None:
        self.name, self.log = names[of.index], Path(of.log)
        self._names, self._index, self._meeting = names, of.index, meeting
        self.turns: Turns[Answer] | None = None
        self.met: Neighbours | None = None

    def neighbours(self, simulated: SimulatedVehicle, log: FlightLog) -> Neighbours:
        """Return the others, as this vehicle meets them."""
        self.met = Neighbours(
            self._meeting,
            names=self._names,
            index=self._index,
            simulated=simulated,
            log=log,
            wait=self._wait,
        )
        return self.met

    def _wait(self) -> None:
        assert self.turns is not None
        self.turns.wait()

    def fly(self, experiment: Experiment, flight: SimulatedFlight) -> str:
        """Fly; return why the experiment ended early, empty if it did not.

        Whatever happens to it, the vehicle comes down before it leaves the others.
        """
        from console.experiments import watched

        assert self.met is not None
        self._wait()
        try:
            if isinstance(experiment, Together):
                experiment.join(self.met)
            watched.fly(experiment, flight)
        except QuadlabError as error:
            _come_down(flight)
            return str(error)
        finally:
            self.met.end()
            self._end()
        return ""

    def _end(self) -> None:
        assert self.turns is not None
        self.turns.end()


def _come_down(flight: Client) -> None:
    from console.experiments.manoeuvres import brake, come_down

    with suppress(QuadlabError):
        if flight.view().airborne and flight.view().mode == "armed":
            brake(flight)
        come_down(flight)
    with suppress(QuadlabError):
        flight.wait_until(lambda v: not v.armed, what="motors off", timeout=LAST)


def run(order: Order) -> Answers:
    """Fly the vehicles. Raises QuadlabError."""
    meeting = Meeting(order.files, len(order.names), [one.index for one in order.vehicles])
    members = {one.index: Member(meeting, order.names, one) for one in order.vehicles}
    turns = Turns(
        meeting,
        {one.index: partial(_fly, order, one, members[one.index]) for one in order.vehicles},
    )
    for member in members.values():
        member.turns = turns
    answers = dict(zip(members, turns.run(), strict=True))
    return Answers(answers, turns.wall, turns.processor)


def _fly(order: Order, of: Vehicle, member: Member) -> Answer:
    from quadlab.simulated.experiment import chosen, fly

    done = fly(
        chosen(order.experiment, member.name),
        seed=of.seed,
        words=of.words,
        plugins=Path(order.plugins),
        board=order.board,
        true_state=order.true_state,
        member=member,
    )
    met, result = member.met, done.result
    assert met is not None
    return Answer(
        result.verdict,
        done.aborted or result.reason,
        result.metrics,
        limits=result.limits,
        flown=done.flight.view().time,
        separations=met.separations,
        collisions=met.collisions,
    )


def main(words: Sequence[str]) -> None:
    """Fly as the order in the first word says, and write the answers to its file."""
    order = msgspec.json.decode(words[0], type=Order)
    die_with_parent(order.parent)
    try:
        answers = run(order)
    except QuadlabError as error:
        answers = Answers(error=" ".join(str(error).split()))
    with os.fdopen(order.answer, "wb") as file:
        file.write(msgspec.json.encode(answers))


if __name__ == "__main__":
    main(sys.argv[1:])
