"""Several vehicles that fly an experiment together in simulated time, on all processors."""

from __future__ import annotations

import math
import os
import selectors
import subprocess
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from quadlab.data_folder import data_folder, open_data_folder
from quadlab.simulated.experiment import (
    LARGEST_SEED,
    check_seed,
    chosen,
    flight_parameters,
    load_kernels,
)
from quadlab.simulated.fleet import SimulatedFleet
from quadlab.simulated.meeting import Meeting
from quadlab.simulated.member import Answer, Answers, Order, Vehicle
from quadlab.simulated.neighbours import radius_of, starts
from quadlab.vehicle_names import THE_VEHICLE
from quadrotor.errors import JobError, UsageError
from vehicle_link import forked
from vehicle_link.jobs import how_it_ended

if TYPE_CHECKING:
    from console.evaluation.result import Result
    from console.experiments.client import Experiment

PROGRAM = "quadlab.simulated.member"
SEED_STEP = 10_000_019
"""Difference between the seeds of two vehicles: more than between those of one's own sensors."""
COLLISIONS, SEPARATION = "collisions", "separation_min_m"
PATIENCE = 5.0
"""s for a process to end by itself once it has answered."""


@dataclass(frozen=True, slots=True)
class FlownTogether:
    """A flight of several vehicles that has ended.

    Attributes:
        experiment: judges them all. folder: of the logs. logs, answers: by the vehicle's name.
        verdict, reason, metrics, limits: of all together.
        wall: s, of flying alone. processor: s, of all processes together.
    """

    experiment: Experiment
    folder: Path
    logs: dict[str, Path]
    answers: dict[str, Answer]
    verdict: str
    reason: str
    metrics: dict[str, float]
    limits: dict[str, float]
    wall: float
    processor: float

    @property
    def flown(self) -> float:
        """Return the longest simulated time, s."""
        return max(one.flown for one in self.answers.values())


def seed_of(seed: int, index: int) -> int:
    """Return the seed of the vehicle with this index, from 0, whose seed is the flight's own."""
    return (seed + index * SEED_STEP) % (LARGEST_SEED + 1)


def fly_together(
    experiment: str,
    count: int,
    *,
    seed: int = 1,
    words: Sequence[str] = (),
    out: Path | None = None,
    plugins: Path | None = None,
    board: str = "mikrokopter",
    true_state: bool = False,
    processes: int | None = None,
) -> FlownTogether:
    """Fly an experiment with several simulated vehicles at once, and judge their logs.

    Args:
        experiment: its name or file. count: of vehicles. seed: of the first one; `seed_of` of the
            others. words: NAME=VALUE of parameters, for one vehicle quad2.NAME=VALUE. out: folder
            in which the folder of the logs is made; None: flights in the data folder. processes:
            that fly the vehicles; None: one for each processor. The flight is the same.

    Raises QuadlabError.
    """
    from vehicle.estimators.offer import offer_plugins
    from vehicle.processes.config import PLUGINS

    fleet = SimulatedFleet(count, THE_VEHICLE, 0)
    check_seed(seed)
    plugins = plugins or data_folder(None) / PLUGINS
    offer_plugins(plugins)
    first = chosen(experiment)
    check_count(first, count)
    own_words = _words_of(first, experiment, fleet.names, seed, words, board)
    folder = _new_folder(
        open_data_folder(out or open_data_folder(None) / "flights", "--out"),
        f"{first.name}_seed{seed}_x{count}",
    )
    load_kernels()
    logs = {name: folder / f"{name}.mcap" for name in fleet.names}
    vehicles = [
        Vehicle(index=k, seed=seed_of(seed, k), words=own_words[name], log=str(logs[name]))
        for k, name in enumerate(fleet.names)
    ]
    order = partial(
        Order,
        parent=os.getpid(),
        names=list(fleet.names),
        experiment=experiment,
        plugins=str(plugins),
        board=board,
        true_state=true_state,
    )
    processes = min(count, processes or len(os.sched_getaffinity(0)))
    return _merged(first, folder, logs, _flown(order, vehicles, processes))


def check_count(experiment: Experiment, count: int) -> None:
    """Check that so many vehicles can fly an experiment. Raises UsageError."""
    from console.experiments.together import Together

    SimulatedFleet(count, THE_VEHICLE, 0).check()
    if isinstance(experiment, Together) and not (
        experiment.vehicles_min <= count <= experiment.vehicles_max
    ):
        raise UsageError(
            f"--vehicles {count}: {experiment.name} is flown by {experiment.vehicles_min} to "
            f"{experiment.vehicles_max} vehicles"
        )


def _words_of(
    first: Experiment,
    experiment: str,
    names: Sequence[str],
    seed: int,
    words: Sequence[str],
    board: str,
) -> dict[str, list[str]]:
    """Return the words for each vehicle, its start among them. Raises QuadlabError."""
    from console.experiments.together import Together
    from vehicle.boards.kind import find_kind

    others = [word for word in words if not _names_vehicle(word, names)]
    kind = find_kind(board)
    flight_parameters(first, kind, seed, others)  # sets its options
    places: Sequence[tuple[float, float]] = ()
    if isinstance(first, Together):
        places = first.start_places(len(names), seed)
    found: dict[str, list[str]] = {}
    taken: list[tuple[str, float, float, float]] = []
    for k, (name, (x, y)) in enumerate(zip(names, places or starts(len(names)), strict=True)):
        own = [word.removeprefix(f"{name}.") for word in words if word.startswith(f"{name}.")]
        where = [f"simulator.start_x={x!r}", f"simulator.start_y={y!r}"]
        found[name] = [*where, *others, *own]
        flown = chosen(experiment, name)
        parameters = flight_parameters(flown, kind, seed_of(seed, k), found[name])
        flown.check()
        simulator = parameters.simulator
        own_place = name, simulator.start_x, simulator.start_y, radius_of(simulator)
        for other, their_x, their_y, radius in taken:
            apart = math.hypot(own_place[1] - their_x, own_place[2] - their_y)
            least = own_place[3] + radius
            if apart <= least:
                raise UsageError(
                    f"{other} and {name} would start {apart:.2f} m apart; more than {least:.2f} m "
                    f"are needed: change {name}.simulator.start_x or {name}.simulator.start_y"
                )
        taken.append(own_place)
    return found


def _names_vehicle(word: str, names: Sequence[str]) -> bool:
    """Return whether a word is for one vehicle. Raises UsageError for one that does not fly."""
    before = word.partition("=")[0].partition(".")[0]
    if before in names:
        return True
    if before.startswith("quad") and before[4:].isdecimal():
        raise UsageError(f"--set {word}: there is no {before}; there are {', '.join(names)}")
    return False


def _flown(order: Callable[..., Order], vehicles: Sequence[Vehicle], count: int) -> list[Answers]:
    """Return how the vehicles have flown, from each of `count` processes. Raises JobError."""
    files = Meeting.new_files(len(vehicles), count)
    answers: list[int] = []
    processes: list[forked.Process] = []
    try:
        for k in range(count):
            read, write = os.pipe()
            answers.append(read)
            os.set_inheritable(write, True)
            told = order(vehicles=vehicles[k::count], files=list(files), answer=write)
            words = [msgspec.json.encode(told).decode()]
            processes.append(forked.start(PROGRAM, words, keep=(*files, write)))
            os.close(write)
        return _answers(dict(zip(answers, processes, strict=True)))
    finally:
        for process in processes:
            process.kill()
            process.wait()
        for file in (*files, *answers):
            os.close(file)


def _answers(processes: Mapping[int, forked.Process]) -> list[Answers]:
    """Read the answers, until all are complete or one says why it ended early. Raises JobError."""
    parts: dict[int, bytes] = dict.fromkeys(processes, b"")
    found: list[Answers] = []
    with selectors.DefaultSelector() as selector:
        for file in processes:
            selector.register(file, selectors.EVENT_READ)
        while selector.get_map():
            for key, _ in selector.select():
                data = os.read(key.fd, 65536)
                parts[key.fd] += data
                if not data:
                    selector.unregister(key.fd)
                    found.append(_answer(parts[key.fd], processes[key.fd]))
    return found


def _answer(data: bytes, process: forked.Process) -> Answers:
    if not data:
        with suppress(subprocess.TimeoutExpired):
            process.wait(PATIENCE)
        raise JobError(f"a process of the vehicles {how_it_ended(process.returncode)}")
    answers = msgspec.json.decode(data, type=Answers)
    if answers.error:
        raise JobError(answers.error)
    return answers


def _merged(
    first: Experiment, folder: Path, logs: dict[str, Path], flown: Sequence[Answers]
) -> FlownTogether:
    """Judge all vehicles together: each has to pass, and none may touch another."""
    from console.experiments.together import Together

    by_index = {k: one for part in flown for k, one in part.vehicles.items()}
    answers = {name: by_index[k] for k, name in enumerate(logs)}
    results = {name: one.result for name, one in answers.items()}
    joint = first.judge(logs, results) if isinstance(first, Together) else worst(results)
    apart = [distance for one in answers.values() for distance in one.separations.values()]
    touches: dict[frozenset[str], str] = {}
    for name, one in answers.items():
        for touch in one.collisions:
            line = f"{name} and {touch.other} collided at {touch.time:.2f} s"
            touches.setdefault(frozenset((name, touch.other)), line)
    metrics = {**joint.metrics, COLLISIONS: float(len(touches))}
    if apart:
        metrics[SEPARATION] = min(apart)
    verdict = "failed" if touches else joint.verdict
    reason = "; ".join(dict.fromkeys([*touches.values(), *filter(None, [joint.reason])]))
    limits = {**joint.limits, COLLISIONS: 0.0}
    return FlownTogether(
        first,
        folder,
        logs,
        answers,
        verdict=verdict,
        reason=reason,
        metrics=metrics,
        limits=limits,
        wall=max(part.wall for part in flown),
        processor=math.fsum(part.processor for part in flown),
    )


def worst(results: Mapping[str, Result]) -> Result:
    """Return the worst verdict, its reasons by name, and of each judged figure the largest."""
    from console.evaluation.result import FAILED, NOT_JUDGED, PASSED, Result

    limits: dict[str, float] = {}
    metrics: dict[str, float] = {}
    for one in results.values():
        limits |= one.limits
        for figure in one.limits:
            if figure in one.metrics:
                metrics[figure] = max(metrics.get(figure, -math.inf), one.metrics[figure])
    verdicts = {one.verdict for one in results.values()}
    verdict = next(one for one in (FAILED, NOT_JUDGED, PASSED) if one in verdicts)
    reasons = [
        f"{name}: {one.reason or 'beyond its limits'}"
        for name, one in results.items()
        if one.verdict == verdict and verdict != PASSED
    ]
    return Result(verdict, metrics, limits, "; ".join(reasons))


def _new_folder(folder: Path, stem: str) -> Path:
    """Return a new folder for the logs, beside those of earlier flights."""
    path, number = folder / stem, 2
    while path.exists():
        path, number = folder / f"{stem}_{number}", number + 1
    path.mkdir(parents=True)
    return path
